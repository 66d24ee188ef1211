//! Detectors and language backends written in Python, in the place of the embedded ones.

use crate::detector::PythonDetector;
use crate::error::InputError;
use crate::interrupt::Interrupt;
use crate::plain::{from_python, to_python};
use dsm::build::{BuildConfig, MapBuilder};
use dsm::eval::Labeller;
use dsm::ground::{
    BackendError, Evidence, Grounder, Query, QueryReader, QueryText, RelatedCandidate, RelationScorer, Verdict,
    Verifier,
};
use dsm::perceive::Annotator;
use dsm::time::Span;
use dsm_tasks::error::TaskError;
use dsm_tasks::language::{Language, LanguageCost, Looks};
use dsm_tasks::late_sight::{Moment, Pace};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::fmt;
use std::sync::Arc;

/// From a frame's stamp to the moment when what a Python detector saw in it is taken in.
const LATENCY: Span = Span(200_000_000);
/// Frames that are held for it at a time.
const MOST_PENDING: usize = 4;

/// What Python plugs in.
#[derive(Clone, Default)]
pub(crate) struct Plugs {
    detector: Option<Plug>,
    language: Option<Plug>,
}

/// One Python object with its name.
#[derive(Clone)]
struct Plug {
    object: Arc<Py<PyAny>>,
    name: String,
    reads: bool,
    scores: bool,
    verifies: bool,
}

impl Plug {
    fn new(py: Python<'_>, object: Py<PyAny>) -> PyResult<Self> {
        let bound = object.bind(py);
        let name = if bound.hasattr("name")? {
            bound.getattr("name")?.extract()?
        } else {
            bound.get_type().name()?.to_string()
        };
        let has = |method: &str| bound.hasattr(method);
        let (reads, scores, verifies) = (has("read")?, has("score")?, has("verify")?);
        Ok(Self { name, reads, scores, verifies, object: Arc::new(object) })
    }
}

impl Plugs {
    /// Checks that the objects have the methods that are called.
    pub(crate) fn new(py: Python<'_>, detector: Option<Py<PyAny>>, language: Option<Py<PyAny>>) -> PyResult<Self> {
        if let Some(detector) = &detector
            && !detector.bind(py).hasattr("detect")?
        {
            return Err(InputError::new_err("detector has no method `detect`; expected detect(frame)"));
        }
        let plug = |object: Option<Py<PyAny>>| object.map(|object| Plug::new(py, object)).transpose();
        let (detector, language) = (plug(detector)?, plug(language)?);
        if language.as_ref().is_some_and(|plug| !(plug.reads || plug.scores || plug.verifies)) {
            return Err(InputError::new_err("language has none of the methods `read`, `score` and `verify`"));
        }
        Ok(Self { detector, language })
    }
}

/// The backend with what Python plugs into it.
pub(crate) fn plugged(below: Arc<dyn Language>, plugs: Plugs, interrupt: &Interrupt) -> Arc<dyn Language> {
    if plugs.detector.is_none() && plugs.language.is_none() {
        return below;
    }
    Arc::new(Plugged { below, plugs, interrupt: interrupt.clone() })
}

struct Plugged {
    below: Arc<dyn Language>,
    plugs: Plugs,
    interrupt: Interrupt,
}

impl fmt::Debug for Plugged {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Plugged").field("below", &self.below).finish_non_exhaustive()
    }
}

impl Language for Plugged {
    fn name(&self) -> &str {
        self.plugs.language.as_ref().map_or(self.below.name(), |plug| &plug.name)
    }

    fn plug_into(&self, grounder: Grounder) -> Grounder {
        let mut grounder = self.below.plug_into(grounder);
        let Some(plug) = &self.plugs.language else { return grounder };
        if plug.reads {
            grounder = grounder.with_reader(Box::new(plug.clone()));
        }
        if plug.scores {
            grounder = grounder.with_scorer(Box::new(plug.clone()));
        }
        if plug.verifies {
            grounder = grounder.with_verifier(Box::new(plug.clone()));
        }
        grounder
    }

    fn annotator(&self) -> Option<Box<dyn Annotator>> {
        self.below.annotator()
    }

    fn labeller(&self) -> Result<Box<dyn Labeller>, TaskError> {
        self.below.labeller()
    }

    fn looks(&self) -> Result<Option<Looks>, TaskError> {
        let Some(plug) = &self.plugs.detector else { return self.below.looks() };
        let object = Python::attach(|py| plug.object.clone_ref(py));
        let detector = Box::new(PythonDetector::new(object, plug.name.clone(), self.interrupt.clone()));
        let pace = Pace {
            every: Span(0),
            most_frames: u32::MAX,
            most_pending: MOST_PENDING,
            latency: LATENCY,
            moment: Moment::Declared,
        };
        Ok(Some(Looks { detector, pace }))
    }

    fn builder(&self, config: BuildConfig) -> Result<MapBuilder, TaskError> {
        self.below.builder(config)
    }

    fn cost(&self) -> Option<LanguageCost> {
        self.below.cost()
    }
}

impl Plug {
    /// Why there is no answer; the embedded backend then answers instead.
    fn failed(&self, error: PyErr) -> BackendError {
        BackendError::Backend { name: self.name.clone(), source: Box::new(error) }
    }

    fn ask<T>(
        &self,
        ask: impl for<'py> FnOnce(Python<'py>, &Bound<'py, PyAny>) -> PyResult<T>,
    ) -> Result<T, BackendError> {
        Python::attach(|py| ask(py, self.object.bind(py))).map_err(|error| self.failed(error))
    }
}

impl QueryReader for Plug {
    fn name(&self) -> &str {
        &self.name
    }

    fn read(&self, said: &QueryText<'_>) -> Result<Vec<Query>, BackendError> {
        self.ask(|py, object| {
            let names = PyList::new(py, said.object_names())?;
            from_python(&object.call_method1("read", (said.text, names))?, "a reading")
        })
    }
}

impl RelationScorer for Plug {
    fn name(&self) -> &str {
        &self.name
    }

    fn score(&self, text: &str, query: &Query, candidates: &[RelatedCandidate<'_>]) -> Result<Vec<f32>, BackendError> {
        self.ask(|py, object| {
            let items = PyList::empty(py);
            for candidate in candidates {
                let item = PyDict::new(py);
                item.set_item("id", candidate.object.id.0)?;
                item.set_item("name", candidate.object.name())?;
                item.set_item("score", candidate.score)?;
                let relations = PyList::empty(py);
                for (kind, other) in &candidate.relations {
                    relations.append((to_python(py, kind)?, other.name()))?;
                }
                item.set_item("relations", relations)?;
                items.append(item)?;
            }
            object.call_method1("score", (text, to_python(py, query)?, items))?.extract()
        })
    }
}

impl Verifier for Plug {
    fn name(&self) -> &str {
        &self.name
    }

    fn wants_views(&self, _: &Query) -> bool {
        true
    }

    fn verify(&self, candidates: &[Evidence<'_>]) -> Result<Vec<Verdict>, BackendError> {
        let Some(first) = candidates.first() else { return Ok(Vec::new()) };
        self.ask(|py, object| {
            let items = PyList::empty(py);
            for evidence in candidates {
                let item = PyDict::new(py);
                item.set_item("id", evidence.candidate.id.0)?;
                item.set_item("name", evidence.candidate.name())?;
                item.set_item("anchors", PyList::new(py, evidence.anchors.iter().map(|anchor| anchor.name()))?)?;
                let views = evidence.views;
                for (level, view) in [("object", &views.object), ("place", &views.place), ("scene", &views.scene)] {
                    let shape = [view.height as usize, view.width as usize, 3];
                    item.set_item(level, PyArray1::from_slice(py, view.color.as_flattened()).reshape(shape)?)?;
                }
                items.append(item)?;
            }
            let verdicts = object.call_method1("verify", (first.text, to_python(py, first.query)?, items))?;
            let verdicts: Vec<(f32, String)> = verdicts.extract()?;
            Ok(verdicts.into_iter().map(|(factor, reason)| Verdict { factor, reason, shown: Vec::new() }).collect())
        })
    }
}
