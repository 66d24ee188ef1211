//! Looking into what was opened: from right before it, down into it, until the map knows what lies there.

use super::drive::{Drive, DriveOutcome};
use super::fronts::gather;
use super::pull::creep;
use crate::agent::{Agent, Gaze, Halt};
use dsm::ground::{Grounder, Grounding, GroundingStatus};
use dsm::map::{Map, MapObject, ObjectId};
use dsm::time::Span;
use dsm_robot::grasp::Handle;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2};
use nalgebra::{Point2, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Distance of the base from an open drawer's handle from which the head sees over its front, metres: the footprint, and
/// what localisation is off.
const NEAR_M: f64 = 0.36;
/// From so far the base creeps near, and so far beside the handle, the best first, metres: outside of what a costmap leaves
/// around obstacles.
const FROM_M: [f64; 5] = [0.75, 0.65, 0.85, 0.55, 1.0];
const ASIDE_M: [f64; 5] = [0.0, 0.12, -0.12, 0.24, -0.24];
/// Room above and below the handle's height in which contents lie, metres.
const RISE_M: (f64, f64) = (-0.16, 0.14);
/// How far beyond the closed front, and from the sides, contents may seem to lie, metres.
const OFF_M: f64 = 0.06;

/// What is larger does not lie in a drawer, metres.
const LARGEST_M: f64 = 0.4;

/// A drawer that stands open. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenDrawer {
    /// Its handle where it was when the drawer was closed.
    pub handle: Handle,
    /// How far it came out, metres.
    pub out_m: f64,
    /// Half of its width at most, metres.
    pub half_m: f64,
}

/// Heights of an open drawer, world frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heights {
    /// What its contents stand on.
    pub floor_m: f64,
    /// Over which they have to be lifted.
    pub rim_m: f64,
}

impl OpenDrawer {
    /// The things of the map that lie where it shows its contents.
    pub(crate) fn contents(&self, map: &Map) -> Vec<ObjectId> {
        let lies = |object: &&MapObject| object.bounds.size.max() < LARGEST_M && self.shows(&object.bounds.center);
        map.stable_objects().filter(lies).map(|object| object.id).collect()
    }

    /// Whether a point lies where an open drawer shows its contents.
    fn shows(&self, point: &Point3<f64>) -> bool {
        let off = point - self.handle.center;
        let out_m = off.dot(&self.handle.normal) + self.handle.off_m;
        let aside_m = off.dot(&Vector3::z().cross(&self.handle.normal)).abs();
        let rise_m = off.z;
        out_m > -OFF_M && out_m < self.out_m && aside_m < self.half_m && rise_m > RISE_M.0 && rise_m < RISE_M.1
    }

    /// Drives right before it and looks down into it; `None` when there is no way there.
    pub fn look(&self, agent: &mut Agent, nav: &NavConfig) -> Result<Option<Heights>, Halt> {
        const LOOK: Span = Span(3_000_000_000);
        const FRAMES: usize = 5;
        /// Floors lie about so far below handles, metres.
        const FLOOR_M: f64 = -0.08;
        /// Fronts rise about so far above handles, metres.
        const RIM_M: f64 = 0.08;
        /// The base creeps no farther than this, metres.
        const FARTHEST_M: f64 = 0.8;
        let normal = self.handle.normal.xy();
        let yaw_rad = (-normal.y).atan2(-normal.x);
        let front = self.handle.center + self.handle.normal * self.out_m;
        let across = Vector3::z().cross(&self.handle.normal).xy();
        let places = ASIDE_M.iter().flat_map(|aside_m| FROM_M.iter().map(move |from_m| (from_m, aside_m)));
        let places = places.map(|(from_m, aside_m)| front.xy() + normal * *from_m + across * *aside_m).collect();
        let Some(position) = find_first_free(agent, nav, places)? else { return Ok(None) };
        agent.gaze = Gaze::AHEAD;
        if Drive::to_pose(nav, Pose2 { position, yaw_rad }).run(agent)? != DriveOutcome::Arrived {
            return Ok(None);
        }
        let middle = self.handle.center + self.handle.normal * (0.5 * self.out_m - self.handle.off_m);
        agent.gaze = Gaze::Point(middle);
        let base = agent.world_from_base()?;
        let left_m = (base.inverse() * front).x - NEAR_M;
        creep(agent, left_m.clamp(0.0, FARTHEST_M), 0.1)?;
        agent.rest(LOOK)?;
        let base_from_points = gather(agent, "head", FRAMES)?;
        let world_from_base = agent.world_from_base()?;
        let inside: Vec<Point3<f64>> =
            base_from_points.iter().map(|p| world_from_base * p).filter(|p| self.shows(p)).collect();
        let floor_m = floor_of(inside.iter().copied()).unwrap_or(self.handle.center.z + FLOOR_M);
        let rim_m = self.rim_of(&inside).unwrap_or(self.handle.center.z + RIM_M).max(floor_m);
        agent.note(format!("looks into the drawer, whose floor is {floor_m:.3} m high and whose front {rim_m:.3} m"));
        Ok(Some(Heights { floor_m, rim_m }))
    }

    /// Looks into it from beside, from the left or the right end: what lies close behind its front is hidden from before.
    /// Whether there was a way there.
    pub fn look_from_beside(&self, agent: &mut Agent, nav: &NavConfig, is_left: bool) -> Result<bool, Halt> {
        const LOOK: Span = Span(3_000_000_000);
        /// From its side, and from the line of its front outwards, the nearest first, metres.
        const BESIDE_M: [f64; 4] = [0.38, 0.46, 0.54, 0.62];
        const OUT_M: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
        let normal = self.handle.normal.xy();
        let across = Vector3::z().cross(&self.handle.normal).xy() * if is_left { -1.0 } else { 1.0 };
        let front = self.handle.center + self.handle.normal * self.out_m;
        let middle = self.handle.center + self.handle.normal * (0.5 * self.out_m - self.handle.off_m);
        let half_m = self.half_m;
        let places = BESIDE_M.iter().flat_map(|beside_m| OUT_M.iter().map(move |out_m| (beside_m, out_m)));
        let places: Vec<Point2<f64>> =
            places.map(|(beside_m, out_m)| front.xy() + across * (half_m + beside_m) + normal * *out_m).collect();
        let Some(position) = find_first_free(agent, nav, places)? else { return Ok(false) };
        agent.gaze = Gaze::AHEAD;
        let place = Pose2::facing(position, &middle.xy());
        if Drive::to_pose(nav, place).run(agent)? != DriveOutcome::Arrived {
            return Ok(false);
        }
        agent.gaze = Gaze::Point(middle);
        agent.rest(LOOK)?;
        Ok(true)
    }

    /// How high its front rises, by points at it, metres; `None` for hardly any.
    fn rim_of(&self, inside: &[Point3<f64>]) -> Option<f64> {
        /// The front is no thicker, and no farther off by what localisation is off, metres.
        const FRONT_M: f64 = 0.04;
        const LEAST: usize = 30;
        /// Share of the points below the rim: a few lie in the air at its edge.
        const BELOW: f64 = 0.95;
        let front = self.handle.center + self.handle.normal * (self.out_m - self.handle.off_m);
        let mut heights: Vec<f64> =
            inside.iter().filter(|p| (*p - front).dot(&self.handle.normal).abs() < FRONT_M).map(|p| p.z).collect();
        heights.sort_by(f64::total_cmp);
        let at = (BELOW * heights.len() as f64) as usize;
        heights.get(at).copied().filter(|_| heights.len() >= LEAST)
    }

    /// What the words mean among what lies there; of several that fit the best.
    pub fn find(&self, agent: &Agent, grounder: &Grounder, words: &str) -> Option<Grounding> {
        let mut there = Map::clone(agent.map());
        there.objects.retain(|_, object| self.shows(&object.bounds.center));
        let grounding = grounder.without_backends().ground(&there, words, None);
        let is_there = matches!(grounding.status, GroundingStatus::Found | GroundingStatus::Ambiguous);
        let grounding = Grounding { status: GroundingStatus::Found, ..grounding };
        Some(grounding).filter(|grounding| is_there && grounding.object_id.is_some())
    }
}

/// The first of the places that the base can drive to.
fn find_first_free(agent: &mut Agent, nav: &NavConfig, places: Vec<Point2<f64>>) -> Result<Option<Point2<f64>>, Halt> {
    let (map, nav) = (agent.map().clone(), nav.clone());
    let start = Pose2::from_pose(&agent.world_from_base()?).position;
    agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &nav.costmap);
        let field = Field::from_start(&costmap, &start);
        let is_place =
            |place: &Point2<f64>| costmap.is_traversable_at(place) && field.find_length_to_m(place).is_some();
        places.into_iter().find(is_place)
    })
}

/// The level at which points cover most, metres; `None` for hardly any.
fn floor_of(points: impl Iterator<Item = Point3<f64>>) -> Option<f64> {
    const CELL_M: f64 = 0.01;
    const BIN_M: f64 = 0.005;
    const LEAST: usize = 40;
    let mut bins: BTreeMap<i32, BTreeSet<[i32; 2]>> = BTreeMap::new();
    for p in points {
        let cell = [p.x, p.y].map(|at| (at / CELL_M).floor() as i32);
        bins.entry((p.z / BIN_M).floor() as i32).or_default().insert(cell);
    }
    let covered = |bin: i32| (bin - 1..=bin + 1).filter_map(|b| bins.get(&b)).map(BTreeSet::len).sum::<usize>();
    let (bin, count) = bins.keys().map(|bin| (*bin, covered(*bin))).max_by_key(|(bin, count)| (*count, -bin))?;
    (count >= LEAST).then(|| (f64::from(bin) + 0.5) * BIN_M)
}

#[cfg(test)]
mod tests {
    //! Contract: contents lie between the closed front and where the drawer came to, at its height.
    use super::*;

    #[test]
    fn contents_lie_within_the_way_of_the_drawer() {
        let handle = Handle {
            center: Point3::new(1.0, 0.0, 0.6),
            along: Vector3::y(),
            length_m: 0.12,
            thick_m: 0.015,
            off_m: 0.04,
            normal: -Vector3::x(),
        };
        let drawer = OpenDrawer { handle, out_m: 0.3, half_m: 0.4 };
        let floor =
            (0..20).flat_map(|i| (0..20).map(move |k| Point3::new(0.01 * f64::from(i), 0.01 * f64::from(k), 0.5)));
        let front = (0..20)
            .flat_map(|i| (0..20).map(move |k| Point3::new(0.0, 0.01 * f64::from(k), 0.5 + 0.01 * f64::from(i))));
        assert!(floor_of(floor.chain(front)).is_some_and(|z| (z - 0.5).abs() < 0.006));
        let board: Vec<Point3<f64>> = (0..200).map(|k| Point3::new(0.74, 0.0, 0.5 + 0.001 * f64::from(k))).collect();
        assert!(drawer.rim_of(&board).is_some_and(|z| (z - 0.69).abs() < 0.002));
        assert_eq!(drawer.rim_of(&board[..10]), None);
        assert_eq!(floor_of(std::iter::once(Point3::origin())), None);
        assert!(drawer.shows(&Point3::new(0.9, 0.2, 0.56)));
        assert!(!drawer.shows(&Point3::new(1.3, 0.2, 0.56)), "still in the furniture");
        assert!(!drawer.shows(&Point3::new(0.9, 0.2, 0.85)), "on top");
        assert!(!drawer.shows(&Point3::new(0.9, 0.5, 0.56)), "beside it");
        assert!(!drawer.shows(&Point3::new(0.6, 0.0, 0.56)), "before it");
    }
}
