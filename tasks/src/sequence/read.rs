//! Reads a sequence frame by frame, whatever its layout.

use super::foreign;
use super::images::{metres, read_color, read_depth};
use super::{DetectionsLine, FrameLine, Head, VERSION};
use crate::error::TaskError;
use dsm::build::Carrier;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::Detections;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How a sequence lies on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Layout {
    /// As `dsm record` writes it.
    Dsm,
    /// TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt.
    Tum,
    /// Replica as ConceptGraphs reads it: results/frame*.jpg, results/depth*.png, traj.txt, cam_params.json.
    Replica,
    /// ScanNet as ConceptGraphs reads it: color/, depth/, pose/, intrinsic/.
    Scannet,
}

/// What a foreign layout leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Focal lengths and principal point (fx, fy, cx, cy) in pixels, the middle of the first pixel at 0.
    pub camera: Option<[f64; 4]>,
    /// Units of the depth images in a metre.
    pub depth_scale: Option<f64>,
}

/// Frames of a sequence, ready to be read in their order.
pub struct Sequence {
    folder: PathBuf,
    lines: Vec<FrameLine>,
    detections: Option<BTreeMap<FrameId, DetectionsLine>>,
    depth_unit_mm: f64,
    /// How it lies on disk.
    pub layout: Layout,
}

/// A frame with what was recorded of it.
pub struct Recorded {
    /// The frame.
    pub frame: RgbdFrame,
    /// What was detected; `None` when nothing was recorded.
    pub detections: Option<Detections>,
    /// Who detected it; empty when nothing was recorded.
    pub detector: String,
    /// What carried the camera.
    pub carrier: Carrier,
}

impl Sequence {
    /// Opens a sequence; its layout is told from its files when it is not given.
    ///
    /// # Errors
    /// [`TaskError`]: no known layout, or a file in it that cannot be read, with file and line.
    pub fn open(folder: &Path, layout: Option<Layout>, options: Options) -> Result<Self, TaskError> {
        if !folder.is_dir() {
            return Err(TaskError::Usage(format!("{}: no such folder", folder.display())));
        }
        let has = |name: &str| folder.join(name).exists();
        let layout = match layout {
            Some(layout) => layout,
            None if has("sequence.json") => Layout::Dsm,
            None if has("rgb.txt") => Layout::Tum,
            None if has("traj.txt") => Layout::Replica,
            None if has("intrinsic") || has("pose") => Layout::Scannet,
            None => {
                let expected = "expected sequence.json (dsm), rgb.txt (tum), traj.txt (replica) or pose/ (scannet)";
                return Err(TaskError::Usage(format!("{}: no known sequence: {expected}", folder.display())));
            }
        };
        let (lines, depth_unit_mm) = match layout {
            Layout::Dsm => {
                let head: Head = read_json(&folder.join("sequence.json"))?;
                if head.version != VERSION {
                    let found = head.version;
                    let path = folder.join("sequence.json");
                    return Err(TaskError::Usage(format!(
                        "{}: version {found} of a sequence is not known, expected {VERSION}",
                        path.display()
                    )));
                }
                (read_lines(&folder.join("frames.jsonl"))?, head.depth_unit_mm)
            }
            Layout::Tum => foreign::tum(folder, options)?,
            Layout::Replica => foreign::replica(folder, options)?,
            Layout::Scannet => foreign::scannet(folder, options)?,
        };
        let detections = if has("detections.jsonl") {
            let lines: Vec<DetectionsLine> = read_lines(&folder.join("detections.jsonl"))?;
            Some(lines.into_iter().map(|line| (line.frame, line)).collect())
        } else {
            None
        };
        Ok(Self { folder: folder.to_owned(), lines, detections, depth_unit_mm, layout })
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Whether detections were recorded.
    pub fn has_detections(&self) -> bool {
        self.detections.is_some()
    }

    /// Reads a frame.
    ///
    /// # Errors
    /// [`TaskError`]: an image that cannot be read or does not fit.
    pub fn read(&self, index: usize) -> Result<Recorded, TaskError> {
        let line = self
            .lines
            .get(index)
            .ok_or_else(|| TaskError::Internal(format!("frame {index} of {}", self.lines.len())))?;
        let depth_path = self.folder.join(&line.depth);
        let depth = read_depth(&depth_path)?;
        let color = read_color(&self.folder.join(&line.color))?;
        // Intrinsics are those of the depth image; colour is picked at its pixels.
        let model = CameraModel { width: depth.width, height: depth.height, ..line.model };
        let same = (color.width, color.height) == (depth.width, depth.height);
        let wrong = |why: String| TaskError::Usage(format!("{}: {why}", depth_path.display()));
        if self.layout == Layout::Dsm && (!same || (depth.width, depth.height) != (line.model.width, line.model.height))
        {
            return Err(wrong("its size is not that of the camera or of the colour image".into()));
        }
        let color = if same {
            color.values
        } else {
            let pick = |i: usize| {
                let (column, row) = (i as u64 % u64::from(depth.width), i as u64 / u64::from(depth.width));
                let column = (2 * column + 1) * u64::from(color.width) / (2 * u64::from(depth.width));
                let row = (2 * row + 1) * u64::from(color.height) / (2 * u64::from(depth.height));
                color.values[(row * u64::from(color.width) + column) as usize]
            };
            (0..depth.values.len()).map(pick).collect()
        };
        let depth_m = match &line.exact_depth {
            Some(name) => read_exact(&self.folder.join(name), model.pixel_count())?,
            None => depth.values.iter().map(|units| metres(*units, self.depth_unit_mm)).collect(),
        };
        let recorded = self.detections.as_ref().and_then(|all| all.get(&line.id));
        let detector = recorded.map(|found| found.detector.clone()).unwrap_or_default();
        let detections = match self.detections.as_ref() {
            None => None,
            Some(_) => {
                let items = recorded.map(|found| found.items.clone()).unwrap_or_default();
                let fit: Option<Vec<_>> = items.into_iter().map(|item| item.find_detection(&model)).collect();
                let items =
                    fit.ok_or_else(|| wrong(format!("a mask of frame {} does not fit the image", line.id.0)))?;
                Some(Detections { frame: line.id, items })
            }
        };
        let frame = RgbdFrame {
            id: line.id,
            stamp: line.stamp,
            camera: line.camera.as_str().into(),
            model,
            world_from_camera: line.world_from_camera,
            color,
            depth_m,
        };
        Ok(Recorded { frame, detections, detector, carrier: line.carrier.clone().into() })
    }
}

fn read_exact(path: &Path, count: usize) -> Result<Vec<f32>, TaskError> {
    let bytes = std::fs::read(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
    if bytes.len() != 4 * count {
        return Err(TaskError::Usage(format!("{}: {} bytes, expected {}", path.display(), bytes.len(), 4 * count)));
    }
    Ok(bytes.chunks_exact(4).map(|four| f32::from_le_bytes(std::array::from_fn(|i| four[i]))).collect())
}

/// A file of the sequence as text.
pub(super) fn read_text(path: &Path) -> Result<String, TaskError> {
    std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })
}

pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, TaskError> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|error| TaskError::Usage(format!("{}: {error}", path.display())))
}

fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, TaskError> {
    let text = read_text(path)?;
    let mut values = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        match serde_json::from_str(line) {
            Ok(value) => values.push(value),
            // A recording that broke off ends in the middle of a line.
            Err(_) if !text.ends_with('\n') && index + 1 == text.lines().count() => {}
            Err(error) => return Err(TaskError::Usage(format!("{}:{}: {error}", path.display(), index + 1))),
        }
    }
    Ok(values)
}
