//! A recording for the Rerun viewer (`.rrd`) of what a run sees and does. Its only timeline is `sim_time`, and identities
//! are counted, not drawn: the same run gives the same chunks, byte for byte. Only the index at the file's end, which the
//! format's library writes, lists its columns in another order each time.
//!
//! | entity | archetype | what |
//! |---|---|---|
//! | `world` | `ViewCoordinates` | x forward, z up |
//! | `world/camera/NAME` | `Transform3D`, `Pinhole` | pose and intrinsics |
//! | `world/camera/NAME/color` | `EncodedImage` | PNG |
//! | `world/camera/NAME/depth` | `EncodedDepthImage` | PNG, 16 bits, millimetres |
//! | `world/camera/NAME/detections` | `Boxes2D` | bounds, names and scores |
//! | `world/camera/NAME/masks` | `SegmentationImage` | a pixel's detection: its place in the list from 1, 0 for none |
//! | `world/camera/NAME/associations` | `dsm.Associations` | `detection` (place from 0), `name`, `object` |
//! | `world/map/ID` | `Boxes3D`, `dsm.Object` | an object: box, name, colour; `state`, `observations`; cleared when removed |
//! | `world/base` | `Transform3D` | where the base stood when a frame was taken |
//! | `world/path` | `LineStrips3D` | the whole way of the base |
//! | `command/base/{forward_m_per_s,turn_rad_per_s}`, `command/{arm,head}/JOINT`, `command/gripper/{width_m,force_n}` | `Scalars` | what was sent, when it changed |
//! | `margins/{clearance_m,speed_m_per_s,control_error,control_distance_m,active_rows}` | `Scalars` | ten times a second |
//! | `log` | `TextLog` | events |

use crate::error::TaskError;
use crate::journal::Sample;
use crate::picture::{color_png, depth_mm_png};
use crate::recording::{Association, RecordingFile, mean_color, opacity};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::RgbdFrame;
use dsm::map::{MapObject, ObjectId};
use dsm::perceive::Detections;
use dsm::store::{StoreError, WholeFile};
use dsm::time::Stamp;
use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;
use nalgebra::{Quaternion, Vector3};
use re_build_info::CrateVersion;
use re_chunk::{Chunk, ChunkId, EntityPath, RowId, TimePoint};
use re_log_encoding::{Encoder, EncodingOptions};
use re_log_types::{EntityPathPart, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource, TimeCell};
use re_sdk_types::archetypes::{
    Boxes2D, Boxes3D, Clear, EncodedDepthImage, EncodedImage, LineStrips3D, Pinhole, Scalars, SegmentationImage,
    TextLog, Transform3D, ViewCoordinates,
};
use re_sdk_types::components::{FillMode, ImageFormat, LineStrip3D, MediaType, PinholeProjection, Text};
use re_sdk_types::datatypes::{self, ChannelDatatype};
use re_sdk_types::external::arrow::array::{Array, UInt64Array};
use re_sdk_types::{AsComponents, DynamicArchetype, SerializedComponentBatch};
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows of one entity are written together when they have gathered this much, bytes: as the viewer's own library does.
const GATHERED_BYTES: usize = 1 << 20;
/// What a row costs beside its data, bytes.
const ROW_BYTES: usize = 256;
/// Detections' boxes.
const GREEN: [u8; 3] = [25, 230, 50];

/// A recording that is being written.
pub struct RerunFile {
    path: PathBuf,
    encoder: Encoder<BufWriter<WholeFile>>,
    store: StoreId,
    /// First half of all identities, so that two recordings in one viewer keep apart.
    origin: u64,
    counted: u64,
    gathered: BTreeMap<EntityPath, Gathered>,
}

/// Rows of an entity that are not written yet.
#[derive(Default)]
struct Gathered {
    rows: Vec<(RowId, TimePoint, Vec<SerializedComponentBatch>)>,
    bytes: usize,
}

/// Creates a recording; `source` says in words what is recorded.
///
/// # Errors
/// [`TaskError::Store`]: it cannot be written.
pub fn create(path: &Path, source: &str) -> Result<RerunFile, TaskError> {
    let file = WholeFile::create(path)?;
    let (version, options) = (CrateVersion::LOCAL, EncodingOptions::PROTOBUF_COMPRESSED);
    let encoder = Encoder::new_eager(version, options, BufWriter::new(file)).map_err(|error| failed(path, error))?;
    // FNV-1a.
    let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    // The upper half counts nanoseconds where others make identities: a positive i64.
    let origin = source.bytes().fold(0xcbf2_9ce4_8422_2325, mix) >> 1;
    let store = StoreId::recording("dsm", source);
    let mut file = RerunFile { path: path.to_owned(), encoder, store, origin, counted: 0, gathered: BTreeMap::new() };
    let info = StoreInfo::new(file.store.clone(), StoreSource::Other("dsm".into()));
    let row_id = *RowId::from_u128(file.next_id());
    file.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id, info }))?;
    file.log_at(TimePoint::STATIC, &["world"], &[&ViewCoordinates::FLU()])?;
    file.flush(&entity(&["world"]))?;
    Ok(file)
}

fn failed(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> StoreError {
    StoreError::Io { path: path.to_owned(), source: std::io::Error::other(error) }
}

fn entity(parts: &[&str]) -> EntityPath {
    parts.iter().map(|part| EntityPathPart::from(*part)).collect()
}

impl RerunFile {
    fn next_id(&mut self) -> u128 {
        self.counted += 1;
        (u128::from(self.origin) << 64) | u128::from(self.counted)
    }

    fn append(&mut self, message: &LogMsg) -> Result<(), StoreError> {
        self.encoder.append(message).map(drop).map_err(|error| failed(&self.path, error))
    }

    fn log(&mut self, stamp: Stamp, parts: &[&str], what: &[&dyn AsComponents]) -> Result<(), StoreError> {
        let at = TimePoint::default().with_index("sim_time", TimeCell::from_duration_nanos(stamp.0));
        self.log_at(at, parts, what)
    }

    fn log_at(&mut self, at: TimePoint, parts: &[&str], what: &[&dyn AsComponents]) -> Result<(), StoreError> {
        let row_id = RowId::from_u128(self.next_id());
        let batches: Vec<_> = what.iter().flat_map(|archetype| archetype.as_serialized_batches()).collect();
        let path = entity(parts);
        let gathered = self.gathered.entry(path.clone()).or_default();
        gathered.bytes += ROW_BYTES + batches.iter().map(|batch| batch.array.get_buffer_memory_size()).sum::<usize>();
        gathered.rows.push((row_id, at, batches));
        if gathered.bytes >= GATHERED_BYTES { self.flush(&path) } else { Ok(()) }
    }

    /// Writes the rows of an entity.
    fn flush(&mut self, path: &EntityPath) -> Result<(), StoreError> {
        let Some(Gathered { rows, .. }) = self.gathered.remove(path) else { return Ok(()) };
        let builder = Chunk::builder_with_id(ChunkId::from_u128(self.next_id()), path.clone());
        let with =
            |builder: re_chunk::ChunkBuilder, (id, at, batches)| builder.with_serialized_batches(id, at, batches);
        let chunk = rows.into_iter().fold(builder, with).build();
        let message = chunk.and_then(|chunk| chunk.to_arrow_msg()).map_err(|error| failed(&self.path, error))?;
        self.append(&LogMsg::ArrowMsg(self.store.clone(), message))
    }

    fn scalar(&mut self, stamp: Stamp, parts: &[&str], value: f64) -> Result<(), StoreError> {
        self.log(stamp, parts, &[&Scalars::single(value)])
    }
}

fn vector(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

fn rotation(q: &Quaternion<f64>) -> datatypes::Quaternion {
    datatypes::Quaternion::from_xyzw([q.i as f32, q.j as f32, q.k as f32, q.w as f32])
}

fn transform(pose: &Pose) -> Transform3D {
    Transform3D::from_translation(vector(&pose.translation.vector)).with_quaternion(rotation(&pose.rotation))
}

/// The corner of the first pixel is 0, as ours.
fn pinhole(model: &CameraModel) -> Pinhole {
    let [focal, principal] = [[model.fx as f32, model.fy as f32], [model.cx as f32, model.cy as f32]];
    Pinhole::new(PinholeProjection::from_focal_length_and_principal_point(focal, principal))
        .with_resolution([model.width as f32, model.height as f32])
}

fn boxes(found: &Detections) -> Boxes2D {
    let (mut corners, mut sizes, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    for item in &found.items {
        let Some((left, top, right, bottom)) = item.mask.find_bounds() else { continue };
        corners.push([left as f32, top as f32]);
        sizes.push([(right + 1 - left) as f32, (bottom + 1 - top) as f32]);
        labels.push(format!("{} {:.2}", item.name, item.score));
    }
    Boxes2D::from_mins_and_sizes(corners, sizes).with_labels(labels).with_colors([GREEN])
}

fn masks(model: &CameraModel, found: &Detections) -> SegmentationImage {
    let mut classes = vec![0_u16; model.pixel_count()];
    for (index, item) in found.items.iter().enumerate() {
        for run in &item.mask.runs {
            let start = run.start as usize;
            classes[start..start + run.length as usize].fill((index + 1).min(usize::from(u16::MAX)) as u16);
        }
    }
    let bytes: Vec<u8> = classes.iter().flat_map(|class| class.to_le_bytes()).collect();
    let format = datatypes::ImageFormat::segmentation([model.width, model.height], ChannelDatatype::U16);
    SegmentationImage::new(bytes, ImageFormat::from(format))
}

fn numbers(values: impl Iterator<Item = u64>) -> Arc<UInt64Array> {
    Arc::new(values.collect())
}

impl RecordingFile for RerunFile {
    fn frame(&mut self, frame: &RgbdFrame, found: &Detections, taken: &[Association<'_>]) -> Result<(), StoreError> {
        let (stamp, camera) = (frame.stamp, ["world", "camera", &*frame.camera]);
        let [a, b, c] = camera;
        self.log(stamp, &camera, &[&transform(&frame.world_from_camera), &pinhole(&frame.model)])?;
        let color = EncodedImage::new(color_png(frame)).with_media_type(MediaType::png());
        self.log(stamp, &[a, b, c, "color"], &[&color])?;
        let depth =
            EncodedDepthImage::new(depth_mm_png(frame)).with_media_type(MediaType::png()).with_meter(1000.0_f32);
        self.log(stamp, &[a, b, c, "depth"], &[&depth])?;
        self.log(stamp, &[a, b, c, "detections"], &[&boxes(found)])?;
        self.log(stamp, &[a, b, c, "masks"], &[&masks(&frame.model, found)])?;
        let associations = DynamicArchetype::new("dsm.Associations")
            .with_component_from_data("detection", numbers(taken.iter().map(|item| item.detection as u64)))
            .with_component::<Text>("name", taken.iter().map(|item| item.name))
            .with_component_from_data("object", numbers(taken.iter().map(|item| item.object.0)));
        self.log(stamp, &[a, b, c, "associations"], &[&associations])
    }

    fn map(&mut self, stamp: Stamp, put: &[&MapObject], removed: &[ObjectId]) -> Result<(), StoreError> {
        for object in put {
            let bounds = &object.bounds;
            let [red, green, blue] = mean_color(object).map(|value| (255.0 * value).round() as u8);
            let shape =
                Boxes3D::from_centers_and_half_sizes([vector(&bounds.center.coords)], [vector(&(0.5 * bounds.size))])
                    .with_quaternions([rotation(&bounds.rotation)])
                    .with_colors([[red, green, blue, (255.0 * opacity(object)).round() as u8]])
                    .with_fill_mode(FillMode::Solid)
                    .with_labels([object.name()]);
            let facts = DynamicArchetype::new("dsm.Object")
                .with_component::<Text>("name", [object.name()])
                .with_component::<Text>("state", [format!("{:?}", object.state).to_lowercase()])
                .with_component_from_data("observations", numbers([u64::from(object.observations)].into_iter()));
            self.log(stamp, &["world", "map", &object.id.0.to_string()], &[&shape, &facts])?;
        }
        for id in removed {
            self.log(stamp, &["world", "map", &id.0.to_string()], &[&Clear::flat()])?;
        }
        Ok(())
    }

    fn base(&mut self, stamp: Stamp, world_from_base: &Pose) -> Result<(), StoreError> {
        self.log(stamp, &["world", "base"], &[&transform(world_from_base)])
    }

    fn path(&mut self, stamp: Stamp, bases: &[(Stamp, Pose)]) -> Result<(), StoreError> {
        let strip = LineStrip3D::from_iter(bases.iter().map(|(_, base)| vector(&base.translation.vector)));
        self.log(stamp, &["world", "path"], &[&LineStrips3D::new([strip])])
    }

    fn base_command(&mut self, stamp: Stamp, twist: Twist) -> Result<(), StoreError> {
        self.scalar(stamp, &["command", "base", "forward_m_per_s"], twist.forward_m_per_s)?;
        self.scalar(stamp, &["command", "base", "turn_rad_per_s"], twist.turn_rad_per_s)
    }

    fn joint_command(&mut self, stamp: Stamp, part: &str, velocities: &JointVelocities) -> Result<(), StoreError> {
        velocities.iter().try_for_each(|(joint, velocity)| self.scalar(stamp, &["command", part, joint], velocity))
    }

    fn gripper_command(&mut self, stamp: Stamp, width_m: f64, force_n: f64) -> Result<(), StoreError> {
        self.scalar(stamp, &["command", "gripper", "width_m"], width_m)?;
        self.scalar(stamp, &["command", "gripper", "force_n"], force_n)
    }

    fn margins(&mut self, sample: &Sample) -> Result<(), StoreError> {
        let control = sample.control;
        let known = [
            ("clearance_m", sample.clearance_m),
            ("speed_m_per_s", Some(sample.speed_m_per_s)),
            ("control_error", control.map(|c| c.error)),
            ("control_distance_m", control.and_then(|c| c.distance_m)),
            ("active_rows", control.map(|c| c.active_rows as f64)),
        ];
        let mut known = known.into_iter().filter_map(|(name, value)| Some((name, value?)));
        known.try_for_each(|(name, value)| self.scalar(sample.stamp, &["margins", name], value))
    }

    fn event(&mut self, stamp: Stamp, what: &str) -> Result<(), StoreError> {
        self.log(stamp, &["log"], &[&TextLog::new(what).with_level("INFO")])
    }

    fn finish(mut self: Box<Self>) -> Result<(), StoreError> {
        let left: Vec<EntityPath> = self.gathered.keys().cloned().collect();
        left.iter().try_for_each(|path| self.flush(path))?;
        let Self { path, mut encoder, .. } = *self;
        encoder.finish().map_err(|error| failed(&path, error))?;
        let file = encoder.into_inner().map_err(|error| failed(&path, error))?;
        file.into_inner().map_err(|error| failed(&path, error.into_error()))?.finish()
    }
}
