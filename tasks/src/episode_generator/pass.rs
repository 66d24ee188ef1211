//! Commands that lead through a closed door: where to start, and which rooms only that door leads to.

use super::home::{Home, HomeObject};
use super::reach::{ROBOT_M, costmap_of};
use super::{EXPLORED_LIMIT_S, Task, choose};
use dsm::knowledge::Knowledge;
use dsm_robot::nav::{Costmap, Field};
use dsm_sim::scene::{SceneModel, Semantics};
use nalgebra::Point2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The share of its way by which the door must stand open at the end: who passed it opened it farther than that.
const AT_LEAST: f64 = 0.4;

/// A way into a room that leads through one closed door, and through no other.
#[derive(Clone, Debug)]
struct Passage {
    start: Point2<f64>,
    length_m: f64,
    door: String,
    leaf: String,
}

/// For each room the shortest such way from any place where robots start.
#[derive(Clone, Debug, Default)]
pub(super) struct Passages(BTreeMap<String, Passage>);

impl Passages {
    /// The ways of a home; none when its floor cannot be told.
    pub(super) fn find(model: &SceneModel, semantics: &Semantics) -> Self {
        let leaves = semantics.find_leaves(model);
        let without = |open: &[usize]| costmap_of(&model.without_solids_of(open), ROBOT_M);
        let Some(closed) = without(&[]) else { return Self::default() };
        let starts: Vec<Point2<f64>> =
            semantics.start.areas.iter().map(|area| Point2::new(area.x_m, area.y_m)).collect();
        let mut ways = BTreeMap::new();
        for leaf in &leaves {
            let others: Vec<usize> = leaves.iter().copied().filter(|other| other != leaf).collect();
            let (Some(opened), Some(all_others)) = (without(&[*leaf]), without(&others)) else { continue };
            for start in starts.iter().filter(|start| closed.is_traversable_at(start)) {
                let reached = |costmap: &Costmap| find_rooms(costmap, start, semantics);
                let around = reached(&all_others);
                for (room, length_m) in reached(&opened) {
                    let nearer = |known: &Passage| known.length_m <= length_m;
                    if around.contains_key(&room) || ways.get(&room).is_some_and(nearer) {
                        continue;
                    }
                    let door = model.bodies[model.find_root(*leaf)].name.clone();
                    let leaf = model.bodies[*leaf].name.clone();
                    ways.insert(room, Passage { start: *start, length_m, door, leaf });
                }
            }
        }
        Self(ways)
    }
}

/// The rooms that a base comes to from a start, with the way into each, metres.
pub(super) fn find_rooms(costmap: &Costmap, start: &Point2<f64>, semantics: &Semantics) -> BTreeMap<String, f64> {
    let field = Field::from_start(costmap, start);
    let grid = costmap.grid();
    let mut rooms = BTreeMap::new();
    for cell in (0..grid.len()).filter(|cell| costmap.is_traversable(*cell)) {
        let Some(length_m) = field.find_length_m(cell) else { continue };
        let Some(room) = semantics.find_room(grid.center_of(cell)) else { continue };
        let shortest: &mut f64 = rooms.entry(room.name.clone()).or_insert(length_m);
        *shortest = shortest.min(length_m);
    }
    rooms
}

/// A thing behind a closed door that was not used yet, to be driven to or lifted.
pub(super) fn find_passing(
    passages: &Passages,
    home: &Home,
    knowledge: &Knowledge,
    used: &mut Vec<String>,
    rng: &mut ChaCha8Rng,
) -> Option<Task> {
    let passage = |object: &HomeObject| object.room.as_ref().and_then(|room| passages.0.get(room));
    let first = rng.random::<bool>();
    let (lifts, (body, name, others)) = [first, !first].into_iter().find_map(|lifts| {
        let wanted = |object: &HomeObject| {
            let suits = if lifts { object.graspable } else { !object.free && object.stands };
            suits && passage(object).is_some()
        };
        Some((lifts, choose(home, knowledge, &wanted, &|_, _| true, used, rng)?))
    })?;
    let way = passage(home.objects.iter().find(|object| object.body == body)?)?;
    let (verbs, kind) =
        if lifts { (["Grasp", "Take"], "object_lifted") } else { (["Go to", "Drive to"], "robot_near") };
    let verb = verbs[rng.random_range(0..2)];
    let yaw_rad = rng.random_range(-PI..PI);
    let (x_m, y_m) = (way.start.x, way.start.y);
    Some(Task {
        body: Some(body.clone()),
        disturbance: String::new(),
        start: format!("\n[start]\nx_m = {x_m:.3}\ny_m = {y_m:.3}\nyaw_rad = {yaw_rad:.3}\n"),
        kind: "pass_door",
        why: format!("{others} Only {} leads there.", way.door),
        command: format!("{verb} the {name}"),
        expect: format!(
            "kind = \"{kind}\"\nobject = \"{body}\"\n\n[[expect]]\nkind = \"joint_open\"\nobject = \"{}\"\npart = \"{}\"\nat_least = {AT_LEAST}",
            way.door, way.leaf
        ),
        time_limit_s: EXPLORED_LIMIT_S,
        explores_first: false,
    })
}
