//! Maps for Python: opened, looked into, asked, saved.

use crate::error::{raised, raised_by_store};
use crate::frame::pose_of;
use crate::interrupt::Interrupt;
use crate::plain::to_python;
use crate::plugged::{Plugs, plugged};
use crate::process::check_process;
use dsm::ground::GroundConfig;
use dsm::store::{load_map, save_map, show_map};
use dsm_tasks::error::TaskError;
use dsm_tasks::language::{EMBEDDED, Language, find_language, grounder};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A Diverse Semantic Map as it was at one moment.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct Map {
    pub(crate) map: Arc<dsm::map::Map>,
    /// Who grounds when nothing else is said.
    pub(crate) language: Option<Arc<dyn Language>>,
}

#[pymethods]
impl Map {
    /// Opens a map file. Of a damaged one whatever is whole is read, and `lost` says what is not.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let loaded = py.detach(|| load_map(&path)).map_err(raised_by_store)?;
        if let Some(loss) = &loaded.loss {
            let text = format!("{}: {loss}", path.display());
            py.import("warnings")?.call_method1("warn", (text,))?;
        }
        Ok(Self { map: Arc::new(loaded.map), language: None })
    }

    /// Saves the compact form.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| save_map(&path, &self.map)).map_err(raised_by_store)
    }

    /// Stable objects, as `dsm map show --json` lists them.
    #[getter]
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &show_map(&self.map).objects)
    }

    /// Relations between stable objects.
    #[getter]
    fn relations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &show_map(&self.map).relations)
    }

    /// Rooms.
    #[getter]
    fn rooms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &show_map(&self.map).rooms)
    }

    /// What the words mean in this map.
    #[pyo3(signature = (text, *, world_from_viewer=None, backend=None, language=None))]
    fn ground<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        world_from_viewer: Option<PyReadonlyArray2<'py, f64>>,
        backend: Option<&str>,
        language: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        check_process()?;
        let viewer = world_from_viewer.map(|pose| pose_of("world_from_viewer", &pose)).transpose()?;
        let plugs = Plugs::new(py, None, language)?;
        let grounding = py.detach(|| {
            let below = match (backend, &self.language) {
                (None, Some(language)) => language.clone(),
                (name, _) => find_language(name.unwrap_or(EMBEDDED))?,
            };
            let language = plugged(below, plugs, &Interrupt::default());
            Ok::<_, TaskError>(grounder(&*language, GroundConfig::default())?.ground(&self.map, text, viewer.as_ref()))
        });
        to_python(py, &grounding.map_err(raised)?)
    }

    fn __repr__(&self) -> String {
        let map = &self.map;
        let objects = map.stable_objects().count();
        format!("<Map of {objects} objects, {} relations, {} rooms>", map.relations.len(), map.rooms.len())
    }
}
