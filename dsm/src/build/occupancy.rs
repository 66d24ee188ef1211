//! Free space from depth: which floor was seen, and what stands over it at which height.
//!
//! Each cell is a column of height bands with a counter of its own. A ray frees only the bands that it crosses, so that
//! looking over a table does not free the table, and seeing the floor beneath it does not either.

use super::carrier::Carrier;
use super::cell_grid::CellGrid;
use super::config::BuildConfig;
use crate::Pose;
use crate::frame::RgbdFrame;
use crate::geometry::{BoxUnion, OrientedBox};
use crate::map::{CellState, FreeSpace, MapChange};
use nalgebra::{Point2, Point3, Vector3};

/// Height bands of a column between obstacle height and headroom: thin, so that looks past the edge of a table top do
/// not free it.
const BANDS: usize = 24;
/// Counter gained by a band in a frame that measured something there.
const HIT: i8 = 2;
/// Counter lost in a frame that looked through.
const MISS: i8 = 1;
/// Counter from which a band is occupied: two frames must agree.
const OCCUPIED: i8 = 4;
/// Lowest counter.
const LOWEST: i8 = -4;
/// Highest counter: seven looks through an obstacle clear it.
const HIGHEST: i8 = 10;
/// Points of a frame in one band of a column and its neighbours that count as a hit.
const HIT_POINTS: u8 = 2;
/// No more points than this are counted.
const MOST_POINTS: u8 = 50;
/// Columns of points across the image, whatever its width.
const POINTS_ACROSS: usize = 160;
/// Every n-th column and row of the points is a ray.
const RAY_STRIDE: usize = 2;
/// A ray stops freeing this far before its end, metres.
const RAY_MARGIN_M: f64 = 0.15;
/// Height from which a column counts as a wall for the division into rooms, metres.
const WALL_HEIGHT_M: f64 = 1.05;

/// Evidence in one column.
#[derive(Clone, Copy, Debug, Default)]
struct Column {
    /// Frames that saw the floor, up to 100.
    floor: i8,
    bands: [i8; BANDS],
}

/// What one frame says of one column.
#[derive(Clone, Copy, Debug, Default)]
struct Look {
    /// Whether anything is said.
    touched: bool,
    floor: u8,
    hits: [u8; BANDS],
    /// Bit per band that a ray crossed.
    crossed: u32,
}

/// What one frame says of the columns around its camera.
#[derive(Clone, Debug, Default)]
struct Looks {
    cells: CellGrid<Look>,
    /// Indices of the cells that the frame said something about.
    touched: Vec<u32>,
}

/// Evidence about all columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Occupancy {
    columns: CellGrid<Column>,
    /// Kept from frame to frame for its memory; empty in between.
    looks: Looks,
}

impl Occupancy {
    /// Counts a frame in and returns the cells whose state differs from the map's.
    pub(super) fn observe(
        &mut self,
        config: &BuildConfig,
        frame: &RgbdFrame,
        world_from_camera: &Pose,
        carrier: &Carrier,
        known: &FreeSpace,
    ) -> Option<MapChange> {
        look(config, frame, world_from_camera, carrier, known, &mut self.looks);
        let mut changes = Vec::new();
        self.looks.touched.sort_unstable();
        for index in self.looks.touched.drain(..) {
            let cell = self.looks.cells.cell_of(index as usize);
            let look = std::mem::take(&mut self.looks.cells.values_mut()[index as usize]);
            let column = self.columns.at_mut(cell);
            column.count(&look);
            let state = column.state();
            if state != CellState::Unknown && state != known.state(cell) {
                changes.push((cell, state));
            }
        }
        carrier.swept.iter().for_each(|swept| self.forget(swept, known, &mut changes));
        self.stand(carrier, known, &mut changes);
        (!changes.is_empty()).then_some(MapChange::Cells(changes))
    }

    /// Bytes of its grids.
    pub(super) fn grids_bytes(&self) -> usize {
        self.columns.held_bytes() + self.looks.cells.held_bytes() + 4 * self.looks.touched.capacity()
    }

    /// Takes back what says that something stands in a box. A depth camera does not tell whether all of it is gone: where a
    /// ray meets nothing in its range it says nothing.
    fn forget(&mut self, swept: &OrientedBox, known: &FreeSpace, changes: &mut Vec<([i32; 2], CellState)>) {
        let (within, box_from_world) = (swept.aabb(), swept.world_from_box().inverse());
        let (low, high) = (known.cell_at(&within.min.xy()), known.cell_at(&within.max.xy()));
        for (row, column) in (low[1]..=high[1]).flat_map(|row| (low[0]..=high[0]).map(move |column| (row, column))) {
            let cell = [column, row];
            let at = known.center_of(cell);
            let at = box_from_world * Point3::new(at.x, at.y, swept.center.z);
            if at.x.abs() > 0.5 * swept.size.x || at.y.abs() > 0.5 * swept.size.y {
                continue;
            }
            let evidence = self.columns.at_mut(cell);
            evidence.bands = evidence.bands.map(|band| band.min(0));
            changes.retain(|(changed, _)| *changed != cell);
            if known.state(cell) == CellState::Occupied {
                changes.push((cell, evidence.state()));
            }
        }
    }

    /// Where the carrier stands there is floor and nothing else.
    fn stand(&mut self, carrier: &Carrier, known: &FreeSpace, changes: &mut Vec<([i32; 2], CellState)>) {
        let Some((center, radius_m)) = carrier.footprint else { return };
        let (low, high) =
            (known.cell_at(&(center.map(|c| c - radius_m))), known.cell_at(&(center.map(|c| c + radius_m))));
        for row in low[1]..=high[1] {
            for column in low[0]..=high[0] {
                let cell = [column, row];
                if (known.center_of(cell) - center).norm() > radius_m {
                    continue;
                }
                let evidence = self.columns.at_mut(cell);
                evidence.floor = evidence.floor.max(1);
                evidence.bands = evidence.bands.map(|band| band.min(0));
                changes.retain(|(changed, _)| *changed != cell);
                if known.state(cell) != CellState::Free {
                    changes.push((cell, CellState::Free));
                }
            }
        }
    }

    /// Whether something tall stands in the cell: a wall as far as rooms are concerned. Furniture over which the camera
    /// looked is none.
    pub(super) fn is_wall(&self, config: &BuildConfig, cell: [i32; 2]) -> bool {
        let column = self.columns.get(cell);
        let first = band_of(config, WALL_HEIGHT_M).unwrap_or(BANDS - 1);
        let tall = &column.bands[first..];
        let occupied = column.bands.iter().any(|band| *band >= OCCUPIED);
        occupied && (tall.iter().any(|band| *band >= OCCUPIED) || tall.iter().all(|band| *band >= 0))
    }
}

impl Column {
    fn count(&mut self, look: &Look) {
        if look.floor > 0 {
            self.floor = self.floor.saturating_add(1).min(100);
        }
        for (band, counter) in self.bands.iter_mut().enumerate() {
            let around = &look.hits[band.saturating_sub(1)..(band + 2).min(BANDS)];
            if look.hits[band] > 0 && around.iter().sum::<u8>() >= HIT_POINTS {
                *counter = (*counter + HIT).min(HIGHEST);
            } else if look.hits[band] == 0 && look.crossed >> band & 1 == 1 {
                *counter = (*counter - MISS).max(LOWEST);
            }
        }
    }

    fn state(&self) -> CellState {
        if self.bands.iter().any(|band| *band >= OCCUPIED) {
            CellState::Occupied
        } else if self.floor > 0 {
            CellState::Free
        } else {
            CellState::Unknown
        }
    }
}

/// The band at a height; `None` below the obstacles or above the headroom.
fn band_of(config: &BuildConfig, height_m: f64) -> Option<usize> {
    let part = (height_m - config.obstacle_height_m) * (1.0 / (config.headroom_m - config.obstacle_height_m));
    (0.0..1.0).contains(&part).then_some((part * BANDS as f64) as usize)
}

impl Looks {
    /// The cell over a place, given in cells from the world's origin; `None` out of reach.
    fn find(&mut self, x: f64, y: f64) -> Option<&mut Look> {
        // As `floor`, which is a call where the processor's own is not assumed.
        let floor = |value: f64| value as i32 - i32::from((value as i32) as f64 > value);
        self.cells.find_index([floor(x), floor(y)]).map(|index| self.touch(index))
    }

    /// The cell of an index, of which something will be said.
    fn touch(&mut self, index: usize) -> &mut Look {
        let look = &mut self.cells.values_mut()[index];
        if !look.touched {
            look.touched = true;
            self.touched.push(index as u32);
        }
        look
    }
}

/// What a frame says about the columns around its camera; `looks` comes empty.
fn look(
    config: &BuildConfig,
    frame: &RgbdFrame,
    world_from_camera: &Pose,
    carrier: &Carrier,
    known: &FreeSpace,
    looks: &mut Looks,
) {
    let bodies = BoxUnion::new(&carrier.bodies, 0.03);
    let eye = Point3::from(world_from_camera.translation.vector);
    let reach = config.max_floor_depth_m * 1.5;
    let low = known.cell_at(&Point2::new(eye.x - reach, eye.y - reach));
    let high = known.cell_at(&Point2::new(eye.x + reach, eye.y + reach)).map(|c| c + 1);
    looks.cells.move_to(low, high);
    let per_m = 1.0 / known.resolution_m;
    let rotation = world_from_camera.rotation.to_rotation_matrix();
    let (width, height) = (frame.model.width as usize, frame.model.height as usize);
    let stride = (width / POINTS_ACROSS).max(1);
    for row in (0..height).step_by(stride) {
        for column in (0..width).step_by(stride) {
            let depth = f64::from(frame.depth_m[row * width + column]);
            if depth.is_nan() || depth <= 0.0 {
                continue;
            }
            let in_range = depth <= config.max_floor_depth_m;
            let used = depth.min(config.max_floor_depth_m);
            let point = eye + rotation * frame.model.back_project(column as u32, row as u32, used).coords;
            if bodies.contains(&point) {
                continue;
            }
            if in_range {
                mark_hit(config, looks, per_m, &point, depth);
            }
            let is_ray = (row / stride).is_multiple_of(RAY_STRIDE) && (column / stride).is_multiple_of(RAY_STRIDE);
            if is_ray {
                mark_crossed(config, looks, per_m, &eye, &point, in_range);
            }
        }
    }
}

fn mark_hit(config: &BuildConfig, looks: &mut Looks, per_m: f64, point: &Point3<f64>, depth_m: f64) {
    // Pitch errors lift far floor: 1 cm per metre.
    let tilt = 0.01 * depth_m;
    if point.z.abs() < config.floor_height_m + tilt {
        if let Some(look) = looks.find(point.x * per_m, point.y * per_m) {
            look.floor = look.floor.saturating_add(1);
        }
    } else if point.z > config.obstacle_height_m + tilt
        && let Some(band) = band_of(config, point.z)
        && let Some(look) = looks.find(point.x * per_m, point.y * per_m)
    {
        look.hits[band] = (look.hits[band] + 1).min(MOST_POINTS);
    }
}

/// Marks the bands that a ray crosses. Steps of a cell's side on the floor, in whole cells from the grid's lowest corner
/// and in bands: no division and no rounding call within the loop, which is most of what a frame costs here.
fn mark_crossed(
    config: &BuildConfig,
    looks: &mut Looks,
    per_m: f64,
    eye: &Point3<f64>,
    point: &Point3<f64>,
    is_hit: bool,
) {
    let ray = point - eye;
    let length = ray.norm();
    let flat = ray.xy().norm();
    if length <= RAY_MARGIN_M || flat < 1e-6 {
        return;
    }
    // A ray that ends on a table top grazes all of it before: it says nothing of the height at which it ends. A level one is
    // at that height all the way, and meets a wall: what stood in its way at the camera's height is gone.
    let level = band_of(config, eye.z);
    let is_level = |end: &usize| level.is_some_and(|level| level.abs_diff(*end) <= 1);
    let grazed = band_of(config, point.z).filter(|end| is_hit && !is_level(end));
    let bands_per_m = BANDS as f64 / (config.headroom_m - config.obstacle_height_m);
    let low = looks.cells.range().0.map(f64::from);
    let scale = Vector3::new(per_m, per_m, bands_per_m);
    let origin = Vector3::new(low[0] / per_m, low[1] / per_m, config.obstacle_height_m);
    let step = (ray / (per_m * flat)).component_mul(&scale);
    let mut place = (eye.coords - origin).component_mul(&scale) + 0.5 * step;
    let reach = (1.0 - RAY_MARGIN_M / length) * flat * per_m;
    let (columns, rows) = looks.cells.size();
    for _ in 0..(reach - 0.5).ceil().max(0.0) as usize {
        let inside = place.x >= 0.0 && place.y >= 0.0 && place.z >= 0.0;
        let (column, row, band) = (place.x as usize, place.y as usize, place.z as usize);
        if inside && column < columns && row < rows && band < BANDS && grazed.is_none_or(|end| band.abs_diff(end) > 1) {
            looks.touch(row * columns + column).crossed |= 1 << band;
        }
        place += step;
    }
}

#[cfg(test)]
mod tests {
    //! Contract: what stood before a camera that looks level, and is gone, leaves no cell closed, at any height.
    use super::*;
    use crate::camera::CameraModel;
    use crate::frame::FrameId;
    use crate::map::{Map, MapUpdate};
    use crate::time::Stamp;
    use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

    #[test]
    fn a_level_camera_sees_that_a_board_is_gone() {
        let (width, height) = (320, 240);
        // Level, along x: a board, or the wall behind it.
        let axes = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let frame = |depth_m: f32| RgbdFrame {
            id: FrameId(0),
            stamp: Stamp::default(),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(width, height, 0.8),
            world_from_camera: Pose::from_parts(Translation3::new(0.02, 0.02, 1.23), rotation),
            color: vec![[0; 3]; (width * height) as usize],
            depth_m: vec![depth_m; (width * height) as usize],
        };
        let (config, mut map, mut occupancy) = (BuildConfig::default(), Map::new(0.05), Occupancy::default());
        let mut see = |depth_m: f32, times: usize| {
            for _ in 0..times {
                let frame = frame(depth_m);
                let world_from_camera = frame.world_from_camera;
                let found =
                    occupancy.observe(&config, &frame, &world_from_camera, &Carrier::default(), &map.free_space);
                map.apply(MapUpdate { stamp: frame.stamp, changes: found.into_iter().collect() });
            }
            let cell = map.free_space.cell_at(&Point2::new(1.02, 0.02));
            (map.free_space.state(cell), occupancy.columns.get(cell))
        };
        assert_eq!(see(1.0, 10).0, CellState::Occupied);
        let (_, column) = see(3.0, 12);
        assert!(column.bands.iter().all(|band| *band < OCCUPIED), "{column:?}");
    }

    #[test]
    fn what_a_leaf_was_moved_through_is_looked_at_afresh() {
        let (config, mut known, mut occupancy) = (BuildConfig::default(), FreeSpace::new(0.05), Occupancy::default());
        for (cell, floor) in [([20, 0], 3), ([21, 0], 0), ([40, 0], 3)] {
            *occupancy.columns.at_mut(cell) = Column { floor, bands: [HIGHEST; BANDS] };
            known.set(cell, CellState::Occupied);
        }
        let swept = OrientedBox {
            center: Point3::new(1.0, 0.0, 1.0),
            size: Vector3::new(0.4, 0.4, 2.0),
            rotation: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4),
        };
        // Nothing in its range: the frame itself says nothing.
        let frame = RgbdFrame {
            id: FrameId(0),
            stamp: Stamp::default(),
            camera: "head".into(),
            model: CameraModel::from_vertical_fov(4, 4, 0.8),
            world_from_camera: Pose::identity(),
            color: vec![[0; 3]; 16],
            depth_m: vec![0.0; 16],
        };
        let carrier = Carrier { swept: vec![swept], ..Carrier::default() };
        let found = occupancy.observe(&config, &frame, &frame.world_from_camera, &carrier, &known);
        let expected = vec![([20, 0], CellState::Free), ([21, 0], CellState::Unknown)];
        assert_eq!(found, Some(MapChange::Cells(expected)));
    }
}
