//! Frames for Python: colour and depth as numpy arrays on the frame's own memory, and frames made in Python.

use crate::error::{InputError, RunError};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::Stamp;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use numpy::ndarray::{ArrayView2, ArrayView3};
use numpy::{PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use std::sync::Arc;

/// Colour and aligned depth of one camera at one moment. It never changes.
#[pyclass(frozen, module = "dsm")]
pub(crate) struct Frame {
    pub(crate) frame: Arc<RgbdFrame>,
}

impl Frame {
    pub(crate) fn new(frame: impl Into<Arc<RgbdFrame>>) -> Self {
        Self { frame: frame.into() }
    }
}

#[pymethods]
impl Frame {
    /// A frame from arrays: colour (height, width, 3) of uint8, depth (height, width) of float32 in metres, intrinsics
    /// (3, 3) in pixels, `world_from_camera` (4, 4). The arrays are copied.
    #[new]
    #[pyo3(signature = (color, depth, intrinsics, world_from_camera, *, stamp_s=0.0, camera="head", id=0))]
    fn from_arrays(
        color: PyReadonlyArray3<'_, u8>,
        depth: PyReadonlyArray2<'_, f32>,
        intrinsics: PyReadonlyArray2<'_, f64>,
        world_from_camera: PyReadonlyArray2<'_, f64>,
        stamp_s: f64,
        camera: &str,
        id: u64,
    ) -> PyResult<Self> {
        let (color, depth, k) = (color.as_array(), depth.as_array(), intrinsics.as_array());
        let &[height, width] = depth.shape() else { return Err(expected("depth", "(height, width)", depth.shape())) };
        if color.shape() != [height, width, 3] {
            return Err(expected("color", &format!("({height}, {width}, 3), as depth has it"), color.shape()));
        }
        if k.shape() != [3, 3] {
            return Err(expected("intrinsics", "(3, 3)", k.shape()));
        }
        let flat: Vec<u8> = color.iter().copied().collect();
        let color = flat.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        let model = CameraModel {
            width: width as u32,
            height: height as u32,
            fx: k[[0, 0]],
            fy: k[[1, 1]],
            cx: k[[0, 2]],
            cy: k[[1, 2]],
        };
        let frame = RgbdFrame {
            id: FrameId(id),
            stamp: Stamp::from_s(stamp_s),
            camera: camera.into(),
            model,
            world_from_camera: pose_of("world_from_camera", &world_from_camera)?,
            color,
            depth_m: depth.iter().copied().collect(),
        };
        Ok(Self::new(frame))
    }

    /// Number of the frame within a run.
    #[getter]
    fn id(&self) -> u64 {
        self.frame.id.0
    }

    /// When the picture was taken, seconds from the run's start.
    #[getter]
    fn stamp_s(&self) -> f64 {
        self.frame.stamp.as_s()
    }

    /// Name of the camera.
    #[getter]
    fn camera(&self) -> &str {
        &self.frame.camera
    }

    /// Colour, sRGB, (height, width, 3) of uint8; it shares the frame's memory and cannot be written.
    #[getter]
    fn color<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let frame = &this.get().frame;
        let shape = (frame.model.height as usize, frame.model.width as usize, 3);
        let view = ArrayView3::from_shape(shape, frame.color.as_flattened()).map_err(unshaped)?;
        // SAFETY: the frame behind the array never changes, and lives as long as the object that the array holds on to.
        #[expect(unsafe_code, reason = "the array shares the frame's memory")]
        let array = unsafe { PyArray3::borrow_from_array(&view, this.clone().into_any()) };
        read_only(array)
    }

    /// Depth along the camera's z in metres, (height, width) of float32, 0 where nothing came back; it shares the
    /// frame's memory and cannot be written.
    #[getter]
    fn depth<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let frame = &this.get().frame;
        let shape = (frame.model.height as usize, frame.model.width as usize);
        let view = ArrayView2::from_shape(shape, &frame.depth_m).map_err(unshaped)?;
        // SAFETY: as for the colour.
        #[expect(unsafe_code, reason = "the array shares the frame's memory")]
        let array = unsafe { PyArray2::borrow_from_array(&view, this.clone().into_any()) };
        read_only(array)
    }

    /// Intrinsics (3, 3) in pixels.
    #[getter]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let m = &self.frame.model;
        matrix(py, &[&[m.fx, 0.0, m.cx], &[0.0, m.fy, m.cy], &[0.0, 0.0, 1.0]])
    }

    /// Where the camera was, as far as the robot knows: (4, 4).
    #[getter]
    fn world_from_camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pose_array(py, &self.frame.world_from_camera)
    }

    fn __repr__(&self) -> String {
        let frame = &self.frame;
        let (width, height) = (frame.model.width, frame.model.height);
        format!("<Frame {} of {} at {:.2} s, {width} x {height}>", frame.id.0, frame.camera, frame.stamp.as_s())
    }
}

/// The same array, which cannot be written from now on.
fn read_only<'py, T: numpy::Element, D: numpy::ndarray::Dimension>(
    array: Bound<'py, PyArray<T, D>>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let borrow = array.try_readwrite().map_err(|error| RunError::new_err(error.to_string()))?;
    drop(borrow.make_nonwriteable());
    Ok(array)
}

fn unshaped(error: numpy::ndarray::ShapeError) -> PyErr {
    InputError::new_err(format!("the frame's pictures do not fit its camera: {error}"))
}

fn expected(what: &str, shape: &str, got: &[usize]) -> PyErr {
    InputError::new_err(format!("{what} has the shape {got:?}; expected {shape}"))
}

fn matrix<'py>(py: Python<'py>, rows: &[&[f64]]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let columns = rows.first().map_or(0, |row| row.len());
    PyArray1::from_vec(py, rows.concat()).reshape([rows.len(), columns])
}

/// A pose as a (4, 4) matrix.
pub(crate) fn pose_array<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let m = pose.to_homogeneous();
    let values = (0..16).map(|i| m[(i / 4, i % 4)]).collect();
    PyArray1::from_vec(py, values).reshape([4, 4])
}

/// The pose of a (4, 4) matrix, which must be a rigid transform.
pub(crate) fn pose_of(what: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Pose> {
    /// Rotations that were written with five digits still count.
    const RIGID: f64 = 1e-4;
    let m = array.as_array();
    if m.shape() != [4, 4] {
        return Err(expected(what, "(4, 4)", m.shape()));
    }
    let rotation = Matrix3::from_fn(|row, column| m[[row, column]]);
    let off = (rotation.transpose() * rotation - Matrix3::identity()).abs().max();
    let last = (0..4).all(|column| m[[3, column]] == f64::from(u8::from(column == 3)));
    if !(off <= RIGID && rotation.determinant() > 0.0 && last && m.iter().all(|value| value.is_finite())) {
        return Err(InputError::new_err(format!("{what} is no rigid transform")));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Ok(Isometry3::from_parts(Translation3::new(m[[0, 3]], m[[1, 3]], m[[2, 3]]), rotation))
}
