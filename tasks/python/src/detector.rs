//! Detectors written in Python.

use crate::error::InputError;
use crate::frame::Frame;
use crate::interrupt::Interrupt;
use dsm::frame::RgbdFrame;
use dsm::perceive::{Detections, Detector, Mask};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

/// One thing that a detector saw: its visible pixels, its name in open vocabulary, and a score from 0 to 1.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct Detection {
    detection: dsm::perceive::Detection,
    height: usize,
}

#[pymethods]
impl Detection {
    /// `mask` is true where the thing is seen: (height, width) of bool, as large as the frame.
    #[new]
    #[pyo3(signature = (mask, name, score=1.0))]
    fn new(mask: PyReadonlyArray2<'_, bool>, name: &str, score: f32) -> PyResult<Self> {
        if !(0.0..=1.0).contains(&score) {
            return Err(InputError::new_err(format!("score is {score}; expected 0 to 1")));
        }
        let name = name.trim().to_lowercase();
        if name.is_empty() {
            return Err(InputError::new_err("name is empty; expected what the thing is called"));
        }
        let mask = mask.as_array();
        let (height, width) = mask.dim();
        let pixels = mask.iter().enumerate().filter(|(_, seen)| **seen).map(|(pixel, _)| pixel as u32);
        let mask = Mask::from_sorted_pixels(width as u32, pixels);
        Ok(Self { detection: dsm::perceive::Detection { mask, name, score }, height })
    }

    /// Its visible pixels, (height, width) of bool; a copy.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let mask = &self.detection.mask;
        let mut seen = vec![false; self.height * mask.image_width as usize];
        mask.pixels().for_each(|pixel| seen[pixel] = true);
        PyArray1::from_vec(py, seen).reshape([self.height, mask.image_width as usize])
    }

    /// Its name, lower case.
    #[getter]
    fn name(&self) -> &str {
        &self.detection.name
    }

    /// Confidence, 0 to 1.
    #[getter]
    fn score(&self) -> f32 {
        self.detection.score
    }

    fn __repr__(&self) -> String {
        let detection = &self.detection;
        format!("<Detection of {}, {:.2}, {} pixels>", detection.name, detection.score, detection.mask.area())
    }
}

/// What was detected, if its mask is as large as the frame.
pub(crate) fn check_size<'a>(seen: &'a Detection, frame: &RgbdFrame) -> PyResult<&'a dsm::perceive::Detection> {
    let Detection { detection, height } = seen;
    let (wanted, given) = ((frame.model.height, frame.model.width), (*height as u32, detection.mask.image_width));
    if given == wanted {
        return Ok(detection);
    }
    let name = &detection.name;
    Err(InputError::new_err(format!("the mask of `{name}` is {given:?}; expected {wanted:?} as the frame is")))
}

/// A Python object with a method `detect(frame)` behind the detector's trait.
pub(crate) struct PythonDetector {
    object: Py<PyAny>,
    name: String,
    /// An exception ends the run.
    interrupt: Interrupt,
}

impl PythonDetector {
    pub(crate) fn new(object: Py<PyAny>, name: String, interrupt: Interrupt) -> Self {
        Self { object, name, interrupt }
    }

    fn ask(&self, py: Python<'_>, frame: &RgbdFrame) -> PyResult<Vec<dsm::perceive::Detection>> {
        let shown = Bound::new(py, Frame::new(frame.clone()))?;
        let mut found = Vec::new();
        for item in self.object.bind(py).call_method1("detect", (shown,))?.try_iter()? {
            let item = item?;
            found.push(check_size(item.cast::<Detection>()?.get(), frame)?.clone());
        }
        Ok(found)
    }
}

impl Detector for PythonDetector {
    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let items = Python::attach(|py| self.ask(py, frame)).unwrap_or_else(|error| {
            self.interrupt.raise(error);
            Vec::new()
        });
        Detections { frame: frame.id, items }
    }

    fn name(&self) -> &str {
        &self.name
    }
}
