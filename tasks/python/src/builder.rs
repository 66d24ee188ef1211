//! Maps built from frames and detections that a program brings, without a robot.

use crate::detector::{Detection, check_size};
use crate::error::{RunError, raised};
use crate::frame::Frame;
use crate::map::Map;
use crate::process::check_process;
use dsm::build::{BuildConfig, Carrier, MapBuilder as Builder};
use dsm::perceive::Detections;
use dsm_tasks::assemble::knowledge;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard};

/// Side of a free-space cell, metres, as in a run.
pub(crate) const CELL_M: f64 = 0.05;

/// The map so far, and what is needed to go on.
struct Building {
    builder: Builder,
    map: dsm::map::Map,
}

/// Builds a map from frames with poses and what was detected in them.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct MapBuilder {
    building: Mutex<Building>,
}

impl MapBuilder {
    fn building(&self) -> PyResult<MutexGuard<'_, Building>> {
        self.building.lock().map_err(|_| RunError::new_err("this builder broke in an earlier call"))
    }
}

#[pymethods]
impl MapBuilder {
    /// Begins an empty map. `detector` names who detects: the map keeps it with the votes.
    #[new]
    #[pyo3(signature = (*, detector="detector"))]
    fn new(detector: &str) -> PyResult<Self> {
        check_process()?;
        let mut builder = Builder::new(BuildConfig::default(), knowledge().map_err(raised)?);
        builder.credit_names_to(detector);
        Ok(Self { building: Mutex::new(Building { builder, map: dsm::map::Map::new(CELL_M) }) })
    }

    /// Takes in a frame and what was detected in it. Frames come in the order of their stamps.
    fn observe(&self, py: Python<'_>, frame: &Frame, detections: Vec<Bound<'_, Detection>>) -> PyResult<()> {
        let frame = frame.frame.clone();
        let mut items = Vec::new();
        for detection in &detections {
            items.push(check_size(detection.get(), &frame)?.clone());
        }
        let detections = Detections { frame: frame.id, items };
        py.detach(|| {
            let mut building = self.building()?;
            let Building { builder, map } = &mut *building;
            let update = builder.observe(map, &frame, &detections, &Carrier::default());
            map.apply(update);
            Ok(())
        })
    }

    /// The map so far.
    #[getter]
    fn map(&self, py: Python<'_>) -> PyResult<Map> {
        let map = py.detach(|| Ok::<_, PyErr>(self.building()?.map.clone()))?;
        Ok(Map { map: Arc::new(map), language: None })
    }
}
