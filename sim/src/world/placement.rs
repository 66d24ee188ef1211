//! What the seed draws about a scene: where things lie and where the robot starts.

use super::solids::{Column, Solids};
use super::truth::FLOOR_TOP_M;
use crate::scene::{Placement, SceneModel, Semantics, StartArea};
use dsm::Pose;
use dsm::geometry::Aabb;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Streams of these draws among all that a seed draws.
const PLACEMENT_STREAM: u64 = 0x706c_6163_6500;
const START_STREAM: u64 = 0x7374_6172_7400;
/// Draws for one object before it stays where it is.
const PLACEMENT_TRIES: usize = 16;
/// Draws for the robot before the scene is said to have no room for it.
const START_TRIES: usize = 2000;
/// A thing stands on what ends this close below it, metres.
const CARRY_GAP_M: f64 = 0.015;
/// Moved things keep this far from others, metres; or as far as they were.
const KEPT_GAP_M: f64 = 0.01;
/// Overlap with what carries a thing that counts as touching, metres.
const TOUCH_M: f64 = 0.001;
/// The middle of a moved thing stays this far from the edge of what carries it, metres.
const SUPPORT_MARGIN_M: f64 = 0.02;
/// Room around the robot's footprint at the start, metres.
const START_MARGIN_M: f64 = 0.05;

/// Where the robot stands on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartPose {
    /// Along the world's x in metres.
    pub x_m: f64,
    /// Along the world's y in metres.
    pub y_m: f64,
    /// Heading about z in radians, 0 along x.
    pub yaw_rad: f64,
}

/// Generator of one part of one stream of a seed.
pub(crate) fn stream(seed: u64, stream: u64, part: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip([seed, stream, part, 0]) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// Moves things within their ranges, each with what it carries, without touching others. What finds no place stays.
pub(super) fn draw_placements(scene: &mut SceneModel, semantics: &Semantics, solids: &Solids, seed: u64) {
    let mut draw = Draw::new(scene, solids);
    let mut order: Vec<(usize, usize, Placement)> = Vec::new();
    for object in &semantics.objects {
        let body = scene.bodies.iter().position(|body| body.name == object.body);
        if let (Some(body), Some(placement)) = (body, object.placement) {
            order.push((draw.rank(body), body, placement));
        }
    }
    // What carries moves first: the things on it find their place on the moved top.
    order.sort_by_key(|(rank, body, _)| (*rank, *body));
    for (_, body, range) in order {
        let mut rng = stream(seed, PLACEMENT_STREAM, body as u64);
        for _ in 0..PLACEMENT_TRIES {
            let mut within = |half: f64| half * (2.0 * rng.random::<f64>() - 1.0);
            let shift = Vector3::new(within(range.x_m), within(range.y_m), 0.0);
            if draw.try_move(body, shift, within(range.yaw_rad)) {
                break;
            }
        }
    }
    for (body, pose) in scene.bodies.iter_mut().zip(draw.poses) {
        body.world_from_body = pose;
    }
}

/// Places for a body of a world in motion, whose poses stand in the scene.
pub(crate) struct Mover<'a>(Draw<'a>);

impl<'a> Mover<'a> {
    /// For a scene whose bodies stand as they stand now.
    pub(crate) fn new(scene: &SceneModel, solids: &'a Solids) -> Self {
        Self(Draw::new(scene, solids))
    }

    /// The poses of a body and of what it carries after a shift over what carries it, when that leaves it there and clear
    /// of all else.
    pub(crate) fn find_moved(&mut self, body: usize, shift: Vector3<f64>, yaw_rad: f64) -> Option<Vec<(usize, Pose)>> {
        self.0.carrier[body]?;
        let moved = self.0.collect_carried(body);
        self.0
            .try_move(body, shift, yaw_rad)
            .then(|| moved.iter().map(|member| (*member, self.0.poses[*member])).collect())
    }
}

struct Draw<'a> {
    solids: &'a Solids,
    poses: Vec<Pose>,
    bounds: Vec<Option<Aabb>>,
    /// What each body stands or hangs on.
    carrier: Vec<Option<usize>>,
}

impl<'a> Draw<'a> {
    fn new(scene: &SceneModel, solids: &'a Solids) -> Self {
        let poses: Vec<Pose> = scene.bodies.iter().map(|body| body.world_from_body).collect();
        let bounds = poses.iter().enumerate().map(|(body, pose)| solids.find_bounds(body, pose)).collect();
        let mut draw = Self { solids, poses, bounds, carrier: Vec::new() };
        draw.carrier = (0..scene.bodies.len()).map(|body| draw.find_carrier(body)).collect();
        // What hangs on a joint moves with what carries it, whatever it stands over.
        for joint in &scene.joints {
            draw.carrier[joint.part] = Some(joint.carrier).filter(|carrier| *carrier != 0);
        }
        draw
    }

    /// The body whose top ends right below this one's underside, if it is not the world itself.
    fn find_carrier(&self, body: usize) -> Option<usize> {
        let own = self.bounds[body]?;
        (1..self.poses.len()).find(|other| *other != body && self.is_over(*other, &own, 0.0))
    }

    /// How many bodies are below this one; bounded, for two bodies may seem to carry each other.
    fn rank(&self, body: usize) -> usize {
        let mut rank = 0;
        let mut at = body;
        while let Some(below) = self.carrier[at].filter(|_| rank < 8) {
            (at, rank) = (below, rank + 1);
        }
        rank
    }

    /// The body and everything that stands on it, directly or not.
    fn collect_carried(&self, body: usize) -> Vec<usize> {
        let mut set = vec![body];
        let mut next = 0;
        while next < set.len() {
            let below = set[next];
            set.extend(
                (0..self.carrier.len())
                    .filter(|b| self.carrier[*b] == Some(below) && !set.contains(b))
                    .collect::<Vec<_>>(),
            );
            next += 1;
        }
        set
    }

    /// Moves a body and what it carries when that leaves it on its support and clear of all else.
    fn try_move(&mut self, body: usize, shift: Vector3<f64>, yaw_rad: f64) -> bool {
        let moved = self.collect_carried(body);
        let origin = self.poses[body].translation.vector;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        let motion = Translation3::from(origin + shift) * turn * Translation3::from(-origin);
        let new_poses: Vec<Pose> = moved.iter().map(|b| motion * self.poses[*b]).collect();
        let new_bounds: Vec<Option<Aabb>> =
            moved.iter().zip(&new_poses).map(|(b, pose)| self.solids.find_bounds(*b, pose)).collect();
        if let (Some(carrier), Some(own)) = (self.carrier[body], new_bounds[0])
            && !self.is_over(carrier, &own, SUPPORT_MARGIN_M)
        {
            return false;
        }
        let clear = moved.iter().zip(&new_poses).zip(&new_bounds).all(|((member, pose), bounds)| {
            let others = (0..self.poses.len()).filter(|other| !moved.contains(other));
            bounds.is_none_or(|bounds| others.into_iter().all(|other| self.is_clear(*member, pose, &bounds, other)))
        });
        if clear {
            for ((member, pose), bounds) in moved.into_iter().zip(new_poses).zip(new_bounds) {
                (self.poses[member], self.bounds[member]) = (pose, bounds);
            }
        }
        clear
    }

    /// Whether the underside of `own` lies right on top of a solid of the carrier, its middle well inside.
    fn is_over(&self, carrier: usize, own: &Aabb, margin_m: f64) -> bool {
        let pose = &self.poses[carrier];
        self.solids.of_body(carrier).iter().any(|solid| {
            let top_m = solid.bounds(pose).max.z;
            (top_m - own.min.z).abs() <= CARRY_GAP_M && solid.is_below(pose, &own.center(), margin_m)
        })
    }

    /// Whether a body at a new pose stays clear of another; never worse than it was in the scene.
    fn is_clear(&self, member: usize, pose: &Pose, bounds: &Aabb, other: usize) -> bool {
        // The world's own geoms: the floor is met by everything, the walls by none.
        let near =
            other == 0 || self.bounds[other].is_some_and(|b| b.grown(KEPT_GAP_M).find_intersection(bounds).is_some());
        if !near {
            return true;
        }
        let depth = |pose: &Pose| {
            self.solids.find_depth_m((member, pose), (other, &self.poses[other]), KEPT_GAP_M).unwrap_or(-KEPT_GAP_M)
        };
        let allowed = if other == 0 || self.carrier[member] == Some(other) { TOUCH_M } else { -KEPT_GAP_M };
        let now = depth(pose);
        now <= allowed || now <= depth(&self.poses[member]) + 1e-6
    }
}

/// The first body in the robot's way when it stands there.
pub(super) fn find_obstruction(
    scene: &SceneModel,
    solids: &Solids,
    start: &StartPose,
    size_m: (f64, f64),
) -> Option<usize> {
    let column = column_at(start, size_m.0, size_m.1);
    let hit = |solid: &&super::solids::Solid| {
        let pose = &scene.bodies[solid.body].world_from_body;
        solid.find_distance_to_column_m(pose, &column, 0.0).is_some()
    };
    solids.iter().find(hit).map(|solid| solid.body)
}

fn column_at(start: &StartPose, radius_m: f64, height_m: f64) -> Column {
    Column { x_m: start.x_m, y_m: start.y_m, radius_m, bottom_m: FLOOR_TOP_M, top_m: height_m }
}

/// A start in one of the scene's areas, or anywhere within the scene when it names none, where the footprint
/// (`size_m`: radius and height of the robot) is free; `None` when no free place was found.
pub(super) fn find_start(
    scene: &SceneModel,
    semantics: &Semantics,
    solids: &Solids,
    size_m: (f64, f64),
    seed: u64,
) -> Option<StartPose> {
    let mut rng = stream(seed, START_STREAM, 0);
    let areas = match semantics.start.areas.as_slice() {
        [] => vec![whole_area(scene, solids)?],
        areas => areas.to_vec(),
    };
    let roomy = (size_m.0 + START_MARGIN_M, size_m.1);
    (0..START_TRIES).find_map(|_| {
        let area = areas[rng.random_range(0..areas.len())];
        let mut within = |half: f64| half * (2.0 * rng.random::<f64>() - 1.0);
        let (x_m, y_m) = (area.x_m + within(area.half_x_m), area.y_m + within(area.half_y_m));
        let start = StartPose { x_m, y_m, yaw_rad: within(PI) };
        find_obstruction(scene, solids, &start, roomy).is_none().then_some(start)
    })
}

/// The rectangle around everything but unbounded floors; 2 m about the origin in an empty scene.
pub(crate) fn scene_bounds(scene: &SceneModel, solids: &Solids) -> Aabb {
    let bounded = solids.iter().filter(|solid| !solid.is_plane);
    let corners: Vec<_> = bounded
        .map(|solid| solid.bounds(&scene.bodies[solid.body].world_from_body))
        .flat_map(|bounds| [bounds.min, bounds.max])
        .collect();
    let empty = Aabb { min: [-1.0, -1.0, 0.0].into(), max: [1.0, 1.0, 1.0].into() };
    Aabb::from_points(&corners).unwrap_or(empty)
}

fn whole_area(scene: &SceneModel, solids: &Solids) -> Option<StartArea> {
    let bounds = scene_bounds(scene, solids);
    let (center, size) = (bounds.center(), bounds.size());
    Some(StartArea { x_m: center.x, y_m: center.y, half_x_m: 0.5 * size.x, half_y_m: 0.5 * size.y })
}

#[cfg(test)]
mod tests {
    //! Contract: the seed moves things within their ranges, together with what they carry, clear of all else; the robot
    //! starts in an area where nothing is in its way.
    use super::*;
    use crate::scene::{ObjectSemantics, StartAreas};

    fn scene() -> (SceneModel, Semantics) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("scene.xml");
        let text = r#"<mujoco><worldbody><geom type="plane" size="0 0 1"/>
            <geom type="box" size=".05 2 1" pos="1.2 0 1"/>
            <body name="table" pos="0 0 .35"><geom type="box" size=".5 .5 .35"/></body>
            <body name="tray" pos="0 0 .711"><freejoint/><geom type="box" size=".2 .2 .01" mass="1"/></body>
            <body name="mug" pos=".1 0 .7715"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>
            <body name="can" pos="-.1 0 .7715"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>
            </worldbody></mujoco>"#;
        std::fs::write(&file, text).expect("written");
        let scene = SceneModel::load(&file).expect("valid");
        let object = |body: &str, x_m, y_m, yaw_rad| ObjectSemantics {
            body: body.to_owned(),
            category: body.to_owned(),
            placement: Some(Placement { x_m, y_m, yaw_rad }),
            ..ObjectSemantics::default()
        };
        let objects = vec![
            object("table", 0.6, 0.3, 3.0),
            object("tray", 0.1, 0.1, 1.0),
            object("mug", 0.2, 0.05, 3.0),
            object("can", 0.2, 0.05, 3.0),
        ];
        let area = StartArea { x_m: -1.5, y_m: 0.0, half_x_m: 1.5, half_y_m: 0.5 };
        (scene, Semantics { version: 1, objects, start: StartAreas { areas: vec![area] }, ..Semantics::default() })
    }

    #[test]
    fn things_move_with_what_carries_them_and_never_overlap() {
        let (before, semantics) = scene();
        let solids = Solids::new(&before).expect("solid");
        let mut yaws = Vec::new();
        for seed in 0..60 {
            let mut after = before.clone();
            draw_placements(&mut after, &semantics, &solids, seed);
            let pose = |body: usize| after.bodies[body].world_from_body;
            let table_shift = pose(1).translation.vector - before.bodies[1].world_from_body.translation.vector;
            assert!(table_shift.x.abs() <= 0.6 && table_shift.y.abs() <= 0.3 && table_shift.z == 0.0);
            for (a, b) in [(0, 1), (1, 2), (2, 3), (2, 4), (3, 4), (0, 3), (0, 4)] {
                let depth = solids.find_depth_m((a, &pose(a)), (b, &pose(b)), 0.1).unwrap_or(-0.1);
                assert!(depth <= TOUCH_M + 1e-4, "seed {seed}: {a} overlaps {b} by {depth}");
            }
            let mug_on_tray = pose(2).inv_mul(&pose(3)).translation.vector;
            assert!(mug_on_tray.x.abs() <= 0.2 + 1e-6 && mug_on_tray.y.abs() <= 0.2 + 1e-6, "{mug_on_tray}");
            assert!((pose(3).translation.z - 0.7715).abs() < 1e-9);
            yaws.push(pose(1).rotation.euler_angles().2);
        }
        assert!(yaws.iter().any(|yaw| *yaw > 1.0) && yaws.iter().any(|yaw| *yaw < -1.0));
    }

    #[test]
    fn the_same_seed_draws_the_same_and_another_differs() {
        let (before, semantics) = scene();
        let solids = Solids::new(&before).expect("solid");
        let drawn = |seed| {
            let mut after = before.clone();
            draw_placements(&mut after, &semantics, &solids, seed);
            after
        };
        assert_eq!(drawn(5), drawn(5));
        assert_ne!(drawn(5), drawn(6));
    }

    #[test]
    fn the_robot_starts_free_and_inside_an_area() {
        let (scene, semantics) = scene();
        let solids = Solids::new(&scene).expect("solid");
        for seed in 0..50 {
            let start = find_start(&scene, &semantics, &solids, (0.27, 1.3), seed).expect("there is room");
            assert!((-3.0..=0.0).contains(&start.x_m) && start.y_m.abs() <= 0.5 && start.yaw_rad.abs() <= PI);
            assert!(start.x_m <= -0.5 - 0.27, "in the table: {start:?}");
            assert!(find_obstruction(&scene, &solids, &start, (0.27, 1.3)).is_none());
        }
        let blocked = StartPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        assert_eq!(find_obstruction(&scene, &solids, &blocked, (0.27, 1.3)), Some(1));
    }
}
