//! What the cameras measured around the base a moment ago.
//!
//! The map confirms an obstacle by several looks and shows it after its latency; a base that drives must not wait for
//! either. This layer keeps the newest points for some seconds: short enough for the pose to be smooth, long enough to
//! remember what the head has turned away from.

use dsm::Pose;
use dsm::frame::RgbdFrame;
use dsm::geometry::{BoxUnion, OrientedBox};
use dsm::time::{Span, Stamp};
use nalgebra::{Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of [`LiveObstacles`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LiveConfig {
    /// Points farther from the camera do not count, metres. Default 2, range 0.5 to 6.
    #[schemars(range(min = 0.5, max = 6.0))]
    pub range_m: f64,
    /// Lowest point that counts, metres above the floor. Default 0.06, range 0.01 to 0.5.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub lowest_m: f64,
    /// Highest point that counts: the top of the robot, metres. Default 1.4, range 0.1 to 3.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub highest_m: f64,
    /// Points of one frame in a cell of 2.5 cm before it counts. Default 3, range 1 to 50.
    #[schemars(range(min = 1, max = 50))]
    pub min_points: u16,
    /// A cell is forgotten so long after it was seen last, seconds. Default 4, range 0.2 to 30.
    #[schemars(range(min = 0.2, max = 30.0))]
    pub memory_s: f64,
    /// Braking that the speed allows for, m/s^2. Default 0.5, range 0.05 to 5.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub braking_m_per_s2: f64,
    /// What the map does not show may come so much nearer while no camera looks at it, m/s: people walk. Default 0.6,
    /// range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub approach_m_per_s: f64,
    /// Distance that is never driven up to, metres. Default 0.015, range 0 to 0.3.
    #[schemars(range(min = 0.0, max = 0.3))]
    pub margin_m: f64,
}

impl Default for LiveConfig {
    fn default() -> Self {
        Self {
            range_m: 2.0,
            lowest_m: 0.06,
            highest_m: 1.4,
            min_points: 3,
            memory_s: 4.0,
            braking_m_per_s2: 0.5,
            approach_m_per_s: 0.6,
            margin_m: 0.015,
        }
    }
}

/// Side of a cell, metres.
const CELL_M: f64 = 0.025;
/// Every n-th column and row of a frame is looked at.
const STRIDE: usize = 4;
/// Tilt of the camera lifts far floor: so much per metre.
const TILT_M_PER_M: f64 = 0.01;
/// Bodies of the robot reach so far beyond their boxes, metres.
const BODY_MARGIN_M: f64 = 0.03;
/// What lies so far inside the footprint cannot be there, metres.
const IMPOSSIBLE_M: f64 = 0.04;

/// No arm reaches what is farther from the camera, metres.
const SURFACE_RANGE_M: f64 = 1.4;
/// Surfaces are remembered so long: the arm hides what it reaches into, and the base stands.
const SURFACE_MEMORY: Span = Span(15_000_000_000);
/// What is seen so far behind a voxel clears it, metres: noise of depth, and the voxel itself.
const CLEARED_M: f64 = 0.06;

/// Obstacles of the last seconds: cells over the floor, and voxels near the arm, with the moment each was seen last. World
/// frame.
#[derive(Clone, Debug, Default)]
pub struct LiveObstacles {
    cells: BTreeMap<[i32; 2], Stamp>,
    voxels: BTreeMap<[i32; 3], Stamp>,
}

impl LiveObstacles {
    /// Side of a voxel of the surfaces near the arm, metres.
    pub const VOXEL_M: f64 = 0.03;

    /// Counts a frame in. `bodies` are the robot's own, world frame; `frame` must carry the pose the robot believes in.
    pub fn observe(&mut self, frame: &RgbdFrame, bodies: &[OrientedBox], config: &LiveConfig) {
        let memory = Span::from_s(config.memory_s);
        self.cells.retain(|_, seen| frame.stamp - *seen <= memory);
        self.voxels.retain(|_, seen| frame.stamp - *seen <= SURFACE_MEMORY);
        let bodies = BoxUnion::new(bodies, BODY_MARGIN_M);
        let mut counts: BTreeMap<[i32; 2], u16> = BTreeMap::new();
        let (width, height) = (frame.model.width as usize, frame.model.height as usize);
        let eye = Point3::from(frame.world_from_camera.translation.vector);
        let rotation = frame.world_from_camera.rotation.to_rotation_matrix();
        for row in (0..height).step_by(STRIDE) {
            for column in (0..width).step_by(STRIDE) {
                let depth = f64::from(frame.depth_m[row * width + column]);
                if depth.is_nan() || depth <= 0.0 || depth > config.range_m {
                    continue;
                }
                let point = eye + rotation * frame.model.back_project(column as u32, row as u32, depth).coords;
                let stands = point.z > config.lowest_m + TILT_M_PER_M * depth && point.z < config.highest_m;
                if stands && !bodies.contains(&point) {
                    *counts.entry(cell_of(&point.xy())).or_default() += 1;
                }
            }
        }
        for (cell, count) in counts {
            if count >= config.min_points {
                self.cells.insert(cell, frame.stamp);
            }
        }
    }

    /// Counts the surfaces of a frame in that are within reach, for an arm that sticks out of the footprint: the map keeps
    /// few points of large things, and misses thin edges of them. `bodies` as for [`Self::observe`].
    pub fn observe_surfaces(&mut self, frame: &RgbdFrame, bodies: &[OrientedBox], config: &LiveConfig) {
        let camera_from_world = frame.world_from_camera.inverse();
        let (width, height) = (frame.model.width as usize, frame.model.height as usize);
        self.voxels.retain(|voxel, seen| {
            let point = camera_from_world * middle_of(*voxel);
            let pixel = frame.model.find_pixel(&point);
            let depth = pixel.map(|(column, row)| f64::from(frame.depth_m[row as usize * width + column as usize]));
            // Gone when something farther shows where it was.
            let is_gone = depth.is_some_and(|depth| depth > point.z + CLEARED_M);
            frame.stamp - *seen <= SURFACE_MEMORY && !is_gone
        });
        let bodies = BoxUnion::new(bodies, BODY_MARGIN_M);
        let pixels = (0..height).step_by(STRIDE).flat_map(|row| (0..width).step_by(STRIDE).map(move |c| (row, c)));
        let mut hits: Vec<[i32; 3]> = pixels
            .filter_map(|(row, column)| {
                let depth = f64::from(frame.depth_m[row * width + column]);
                let in_reach = depth > 0.0 && depth < SURFACE_RANGE_M;
                let seen = in_reach.then(|| frame.model.back_project(column as u32, row as u32, depth))?;
                let point = frame.world_from_camera * seen;
                let counts = point.z > config.lowest_m && !bodies.contains(&point);
                counts.then(|| [point.x, point.y, point.z].map(|v| (v / Self::VOXEL_M).floor() as i32))
            })
            .collect();
        hits.sort_unstable();
        for voxel in hits.chunk_by(|a, b| a == b).filter(|same| same.len() >= usize::from(config.min_points)) {
            self.voxels.insert(voxel[0], frame.stamp);
        }
    }

    /// Centres of the voxels that hold a surface.
    pub fn surfaces(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        self.voxels.keys().map(|voxel| middle_of(*voxel))
    }

    /// Centres of the cells that hold something.
    pub fn points(&self) -> impl Iterator<Item = Point2<f64>> + '_ {
        self.cells.keys().map(|cell| center_of(*cell))
    }

    /// What holds a round base of `radius_m` back when it drives straight on. What is not `known` to stand there may have
    /// come nearer since it was seen.
    pub fn find_speed_limits(
        &self,
        (now, world_from_base): (Stamp, &Pose),
        radius_m: f64,
        known: &dyn Fn(&Point2<f64>) -> bool,
        config: &LiveConfig,
    ) -> SpeedLimits {
        const LOOK_AHEAD_M: f64 = 1.0;
        /// Frames come at such intervals: what is no older was seen just now.
        const JUST_NOW: Span = Span(300_000_000);
        let kept_m = radius_m + config.margin_m;
        let base_from_world = world_from_base.inverse();
        let here = Point2::from(world_from_base.translation.vector.xy());
        let reach_m = LOOK_AHEAD_M + kept_m + config.approach_m_per_s * config.memory_s;
        let low = cell_of(&Point2::new(here.x - reach_m, here.y - reach_m));
        let high = cell_of(&Point2::new(here.x + reach_m, here.y + reach_m));
        let mut nearest = [(LOOK_AHEAD_M, None); 2];
        for (cell, seen) in self.cells.range([low[0], i32::MIN]..=[high[0], i32::MAX]) {
            if cell[1] < low[1] || cell[1] > high[1] {
                continue;
            }
            let place = center_of(*cell);
            let point = base_from_world * Point3::new(place.x, place.y, 0.0);
            // What the base stands in is not there.
            let chord = kept_m * kept_m - point.y * point.y;
            if point.x.hypot(point.y) < radius_m - IMPOSSIBLE_M || chord <= 0.0 {
                continue;
            }
            let unseen = Span((now.0 - seen.0 - JUST_NOW.0).max(0));
            let nearer_m = config.approach_m_per_s * unseen.as_s();
            let way_m = point.x.abs() - chord.sqrt();
            let has_come = nearer_m > 0.0 && way_m - nearer_m < LOOK_AHEAD_M && !known(&place);
            let way_m = if has_come { way_m - nearer_m } else { way_m }.max(0.0);
            let side = &mut nearest[usize::from(point.x < 0.0)];
            if way_m < side.0 {
                *side = (way_m, Some(place));
            }
        }
        let limit = |way_m: f64, at: Option<Point2<f64>>| match at {
            Some(_) => (2.0 * config.braking_m_per_s2 * way_m).sqrt(),
            None => f64::INFINITY,
        };
        let [(ahead_m, ahead), (behind_m, behind)] = nearest;
        SpeedLimits { forward_m_per_s: limit(ahead_m, ahead), backward_m_per_s: limit(behind_m, behind), ahead }
    }
}

/// Speeds at which the base can still stop before what the cameras showed: sqrt(2 a d) over the straight way d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimits {
    /// Forward; infinite when nothing is in the way.
    pub forward_m_per_s: f64,
    /// Backward.
    pub backward_m_per_s: f64,
    /// What is next ahead, world frame.
    pub ahead: Option<Point2<f64>>,
}

impl SpeedLimits {
    /// Nothing is in the way.
    pub const NONE: Self = Self { forward_m_per_s: f64::INFINITY, backward_m_per_s: f64::INFINITY, ahead: None };
}

fn middle_of(voxel: [i32; 3]) -> Point3<f64> {
    Point3::from(voxel.map(|v| (f64::from(v) + 0.5) * LiveObstacles::VOXEL_M))
}

fn cell_of(point: &Point2<f64>) -> [i32; 2] {
    [(point.x / CELL_M).floor() as i32, (point.y / CELL_M).floor() as i32]
}

fn center_of(cell: [i32; 2]) -> Point2<f64> {
    Point2::new((f64::from(cell[0]) + 0.5) * CELL_M, (f64::from(cell[1]) + 0.5) * CELL_M)
}

#[cfg(test)]
mod tests {
    //! Contract: what a frame shows limits the speed towards it at once and in no other direction; the robot itself does
    //! not count; what was not seen for a while is forgotten.
    use super::*;
    use dsm::camera::CameraModel;
    use nalgebra::{Rotation3, Translation3, UnitQuaternion, Vector3};

    /// A camera 1 m up that looks along world x; a board 1.2 m ahead fills its lower middle.
    fn frame(stamp_s: f64) -> RgbdFrame {
        let model = CameraModel::from_vertical_fov(640, 480, 1.0);
        // Camera z along world x, camera x along world -y.
        let rotation = Rotation3::from_basis_unchecked(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
        let world_from_camera =
            Pose::from_parts(Translation3::new(0.0, 0.0, 1.0), UnitQuaternion::from_rotation_matrix(&rotation));
        let mut depth_m = vec![0.0_f32; 640 * 480];
        for row in 260..480 {
            for column in 300..340 {
                depth_m[row * 640 + column] = 1.2;
            }
        }
        RgbdFrame {
            id: dsm::frame::FrameId(1),
            camera: "head".into(),
            stamp: Stamp(0) + Span::from_s(stamp_s),
            model,
            world_from_camera,
            color: vec![[0; 3]; 640 * 480],
            depth_m,
        }
    }

    fn limits(live: &LiveObstacles, yaw_rad: f64) -> SpeedLimits {
        let pose = Pose::from_parts(Translation3::identity(), UnitQuaternion::from_euler_angles(0.0, 0.0, yaw_rad));
        live.find_speed_limits((Stamp(0) + Span::from_s(1.0), &pose), 0.27, &|_| false, &LiveConfig::default())
    }

    #[test]
    fn what_nobody_looks_at_may_come_nearer() {
        let mut live = LiveObstacles::default();
        live.observe(&frame(1.0), &[], &LiveConfig::default());
        let after = |s: f64, known: bool| {
            let now = Stamp(0) + Span::from_s(1.0 + s);
            live.find_speed_limits((now, &Pose::identity()), 0.27, &|_| known, &LiveConfig::default()).forward_m_per_s
        };
        let way_m = 1.2 - 0.285;
        assert!((after(1.3, false) - (2.0 * 0.5 * (way_m - 0.6_f64)).sqrt()).abs() < 0.03, "{}", after(1.3, false));
        assert_eq!(after(0.2, false), after(0.0, false), "it was seen just now");
        assert_eq!(after(1.3, true), after(0.0, true), "walls stay where they are");
        assert!(after(2.5, false) < 0.01);
    }

    #[test]
    fn a_board_ahead_limits_the_speed_towards_it() {
        let mut live = LiveObstacles::default();
        live.observe(&frame(1.0), &[], &LiveConfig::default());
        // The way is 1.2 m less the radius and the margin.
        let expected = (2.0 * 0.5 * (1.2_f64 - 0.285)).sqrt();
        let towards = limits(&live, 0.0);
        assert!((towards.forward_m_per_s - expected).abs() < 0.03, "{towards:?}");
        assert_eq!(towards.backward_m_per_s, f64::INFINITY);
        assert!((towards.ahead.expect("a board").x - 1.2).abs() < 0.03);
        assert_eq!(limits(&live, 1.2), SpeedLimits::NONE);
        assert!(limits(&live, std::f64::consts::PI).backward_m_per_s.is_finite());
    }

    #[test]
    fn surfaces_in_reach_are_kept_for_the_arm() {
        let mut near = frame(1.0);
        near.depth_m.iter_mut().for_each(|depth| *depth = (*depth - 0.2).max(0.0));
        let mut live = LiveObstacles::default();
        live.observe_surfaces(&near, &[], &LiveConfig::default());
        let board: Vec<Point3<f64>> = live.surfaces().collect();
        assert!(board.len() > 30, "{}", board.len());
        assert!(
            board.iter().all(|point| (point.x - 1.0).abs() < LiveObstacles::VOXEL_M && point.y.abs() < 0.15),
            "{board:?}"
        );
        // The arm before the camera hides it; a wall behind it shows that it has gone; at last it is forgotten.
        let at = |stamp_s: f64, depth_m: f32| {
            let mut other = frame(stamp_s);
            other.depth_m.fill(depth_m);
            other
        };
        let hidden = OrientedBox {
            center: Point3::new(0.4, 0.0, 1.0),
            size: Vector3::repeat(0.7),
            rotation: UnitQuaternion::identity(),
        };
        let mut hides = live.clone();
        hides.observe_surfaces(&at(6.0, 0.4), &[hidden], &LiveConfig::default());
        assert!(hides.surfaces().filter(|point| point.x > 0.9).count() > 30);
        hides.observe(&at(20.0, 0.0), &[], &LiveConfig::default());
        assert_eq!(hides.surfaces().count(), 0);
        live.observe_surfaces(&at(6.0, 3.0), &[], &LiveConfig::default());
        assert_eq!(live.surfaces().count(), 0);
    }

    #[test]
    fn the_robot_itself_and_what_is_long_gone_do_not_count() {
        let body = OrientedBox {
            center: Point3::new(1.2, 0.0, 0.5),
            size: Vector3::repeat(1.0),
            rotation: UnitQuaternion::identity(),
        };
        let mut live = LiveObstacles::default();
        live.observe(&frame(1.0), &[body], &LiveConfig::default());
        assert_eq!(live.points().count(), 0);
        live.observe(&frame(1.0), &[], &LiveConfig::default());
        assert!(live.points().count() > 0);
        let mut empty = frame(6.0);
        empty.depth_m.fill(0.0);
        live.observe(&empty, &[], &LiveConfig::default());
        assert_eq!(live.points().count(), 0);
    }
}
