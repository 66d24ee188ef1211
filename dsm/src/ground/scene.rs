//! The map as the reasoner looks at it: stable objects in arrays, edges by pair.

use super::answer::ReferenceFrame;
use super::spoken_names::SpokenNames;
use crate::Pose;
use crate::geometry::{Aabb, intersection_area_m2};
use crate::knowledge::{Category, Knowledge};
use crate::map::{CellState, Map, MapObject, ObjectId, RelationKind, Room, RoomId};
use nalgebra::{Point2, Point3, Vector2};
use std::collections::BTreeMap;

/// A stable object with what is asked of it often.
pub(super) struct Item<'a> {
    pub(super) object: &'a MapObject,
    /// Box along the world axes.
    pub(super) bounds: Aabb,
}

/// All that a query is grounded in. Built once per query.
pub(super) struct Scene<'a> {
    pub(super) map: &'a Map,
    pub(super) items: Vec<Item<'a>>,
    /// What the items are called.
    pub(super) names: SpokenNames<'a>,
    /// Category by item, where its name is known.
    pub(super) categories: Vec<Option<&'a Category>>,
    /// Stored relations by the item they start from: where they lead, kind, confidence.
    edges: Vec<Vec<(usize, RelationKind, f32)>>,
    /// Place in the map by the identity of a room; of several with one identity, the first.
    room_places: BTreeMap<RoomId, usize>,
    /// The box around all objects; empty at the origin without any.
    pub(super) extent: Aabb,
    /// Middle of all objects, in the world frame.
    pub(super) center: Point2<f64>,
    viewer: Option<Point2<f64>>,
    /// Where an object's front points, unit in the floor plane, for those whose front is known.
    pub(super) fronts: BTreeMap<ObjectId, [f64; 2]>,
    /// Where the viewer is said to look, whatever is asked; unit.
    told: Option<Vector2<f64>>,
}

/// Where a viewer looks when facing a place; both unit, in the world's floor plane.
pub(super) struct View {
    pub(super) forward: Vector2<f64>,
    pub(super) left: Vector2<f64>,
    pub(super) frame: ReferenceFrame,
}

/// A viewer closer than this to what it faces cannot tell left from right, metres.
const NEAREST_VIEW_M: f64 = 0.3;

impl<'a> Scene<'a> {
    pub(super) fn new(map: &'a Map, knowledge: &'a Knowledge, world_from_viewer: Option<&Pose>) -> Self {
        let items: Vec<Item<'a>> =
            map.stable_objects().map(|object| Item { object, bounds: object.bounds.aabb() }).collect();
        let index_of: BTreeMap<_, usize> = items.iter().enumerate().map(|(i, item)| (item.object.id, i)).collect();
        let mut edges = vec![Vec::new(); items.len()];
        for relation in &map.relations {
            if let (Some(&from), Some(&to)) = (index_of.get(&relation.from), index_of.get(&relation.to)) {
                edges[from].push((to, relation.kind, relation.confidence));
            }
        }
        let names = SpokenNames::of(items.iter().map(|item| item.object));
        let mut known: Vec<Option<Option<&Category>>> = vec![None; names.all.len()];
        let mut category = |name: &usize| *known[*name].get_or_insert_with(|| knowledge.find(names.all[*name]));
        let categories = names.winners.iter().map(&mut category).collect();
        let mut room_places = BTreeMap::new();
        for (place, room) in map.rooms.iter().enumerate() {
            room_places.entry(room.id).or_insert(place);
        }
        let mut all: Option<Aabb> = None;
        for item in &items {
            all =
                Some(all.map_or(item.bounds, |b| Aabb {
                    min: b.min.inf(&item.bounds.min),
                    max: b.max.sup(&item.bounds.max),
                }));
        }
        let extent = all.unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() });
        let center = extent.center().xy();
        let viewer = world_from_viewer.map(|pose| Point3::from(pose.translation.vector).xy());
        let viewer = viewer.filter(|v| v.coords.iter().all(|c| c.is_finite()));
        let fronts = BTreeMap::new();
        Self { map, items, names, categories, edges, room_places, extent, center, viewer, fronts, told: None }
    }

    /// As seen by a viewer who looks in the direction `forward`.
    pub(super) fn facing(mut self, forward: Vector2<f64>) -> Self {
        self.told = Some(forward);
        self
    }

    /// Whether the words tell where the viewer looks.
    pub(super) fn is_told(&self) -> bool {
        self.told.is_some()
    }

    /// With known fronts; those without a direction in the floor plane are left out.
    pub(super) fn with_fronts(mut self, fronts: &BTreeMap<ObjectId, [f64; 2]>) -> Self {
        let unit = |(id, front): (&ObjectId, &[f64; 2])| {
            let length = front[0].hypot(front[1]);
            (length.is_finite() && length > 0.1).then(|| (*id, front.map(|c| c / length)))
        };
        self.fronts = fronts.iter().filter_map(unit).collect();
        self
    }

    /// Confidence of a stored relation, 0 when it is not stored.
    pub(super) fn stored(&self, from: usize, to: usize, kind: RelationKind) -> f32 {
        let edges = self.edges[from].iter().filter(|edge| edge.0 == to && edge.1 == kind);
        edges.map(|edge| edge.2).fold(0.0, f32::max)
    }

    /// By item, whether a relation is stored between it and one of these.
    pub(super) fn linked_to(&self, anchors: impl Iterator<Item = usize>) -> Vec<bool> {
        let mut is_anchor = vec![false; self.items.len()];
        anchors.for_each(|anchor| is_anchor[anchor] = true);
        let mut linked = vec![false; self.items.len()];
        for (from, edges) in self.edges.iter().enumerate() {
            for (to, ..) in edges {
                linked[*to] |= is_anchor[from];
                linked[from] |= is_anchor[*to];
            }
        }
        linked
    }

    /// Whether an item is most likely a second entry of another one: of its name and in its very place, of a name like its
    /// own and a piece of it, or seen a few times only where a well-known thing stands. A map in the making holds such
    /// entries until they are merged or die.
    pub(super) fn is_double(&self, item: usize, of: usize, knowledge: &Knowledge) -> bool {
        const FEW: u32 = 8;
        const TIMES: u32 = 8;
        const COMMON_SHARE: f64 = 0.5;
        const GAP_M: f64 = 0.1;
        const SAME_PLACE_SHARE: f64 = 0.6;
        /// Boxes of the map are too large by a little: solid things that touch share less of the smaller one than this.
        const SOLID_SHARE: f64 = 0.35;
        const SELDOM: u32 = 2;
        /// What is lower than this share of a thing is a slice of it, and no smaller one that stands in it.
        const FLAT_SHARE: f64 = 0.4;
        /// Pieces of one thing that lie over each other have their middles within this share of their width.
        const ASIDE_SHARE: f64 = 0.25;
        /// The pieces of a torn thing end so far from each other, above and below; share of the lower one's height.
        const TORN_SHARE: f64 = 0.25;
        /// Similarity of names from which one is said for the other.
        const ALIKE: f32 = 0.5;
        let (double, known) = (self.items[item].object, self.items[of].object);
        let (near, far) = (self.items[item].bounds.grown(GAP_M), &self.items[of].bounds);
        if item == of || (0..3).any(|i| near.max[i] < far.min[i] || far.max[i] < near.min[i]) {
            return false;
        }
        let (a, b) = (&double.bounds, &known.bounds);
        if double.observations < known.observations && double.name() == known.name() {
            // Bowls stand in bowls and drawers in chests; nothing else of one name holds another one's middle.
            let nests = self.categories[item].is_none_or(|category| !category.graspable || category.is_a("container"));
            let is_flat = a.height_m() < FLAT_SHARE * b.height_m();
            let inside = b.contains(&a.center, 0.0) && (!nests || is_flat || a.contains(&b.center, 0.0));
            let smaller = a.volume_m3().min(b.volume_m3());
            let common = a.intersection_volume_m3(b);
            if inside && common > SAME_PLACE_SHARE * smaller {
                return true;
            }
            // Solid things do not stand in each other: one was moved while it was looked at, or the pose was off.
            let is_seldom = SELDOM * double.observations <= known.observations;
            if !nests && is_seldom && common > SOLID_SHARE * smaller {
                return true;
            }
            // Furniture does not stand on furniture of its name: it is torn into an upper and a lower piece, either of
            // which sticks out of the other.
            let is_furniture = self.categories[item].is_some_and(|category| !category.graspable);
            let aside_m = (a.center - b.center).xy().norm();
            let over = aside_m < ASIDE_SHARE * a.size.xy().min().min(b.size.xy().min());
            let apart_m = TORN_SHARE * a.height_m().min(b.height_m());
            let torn = (a.bottom_m() - b.bottom_m()).abs().min((a.top_m() - b.top_m()).abs()) > apart_m
                && (a.bottom_m() < b.bottom_m()) == (a.top_m() < b.top_m());
            if is_furniture && over && torn {
                return true;
            }
        }
        if known.observations < TIMES * double.observations {
            return false;
        }
        let is_alike = || match (self.categories[item], self.categories[of]) {
            (Some(a), Some(b)) => knowledge.category_similarity(a, b) >= ALIKE,
            _ => false,
        };
        if double.observations >= FEW && !is_alike() {
            return false;
        }
        let outline = a.footprint();
        let common = intersection_area_m2(&outline, &b.footprint());
        let area = intersection_area_m2(&outline, &outline);
        common > COMMON_SHARE * area && a.bottom_m() < b.top_m() + GAP_M && b.bottom_m() < a.top_m() + GAP_M
    }

    /// Where the viewer stands; without one, the middle of the map.
    pub(super) fn standpoint(&self) -> (Point2<f64>, ReferenceFrame) {
        self.viewer.map_or((self.center, ReferenceFrame::SceneCenter), |viewer| (viewer, ReferenceFrame::Viewer))
    }

    /// The viewer's frame when facing `place`: the given viewer, else one who stands on the open floor before it, else one
    /// at the middle of the map, else along world x.
    pub(super) fn view_to(&self, place: Point2<f64>) -> View {
        if let Some(forward) = self.told {
            return View { forward, left: Vector2::new(-forward.y, forward.x), frame: ReferenceFrame::Viewer };
        }
        let from = |eye: Point2<f64>, frame| {
            let forward = place - eye;
            (forward.norm() > NEAREST_VIEW_M).then(|| (forward.normalize(), frame))
        };
        let (forward, frame) = self
            .viewer
            .and_then(|viewer| from(viewer, ReferenceFrame::Viewer))
            .or_else(|| Some((-self.find_open_side(place)?, ReferenceFrame::OpenSide)))
            .or_else(|| from(self.center, ReferenceFrame::SceneCenter))
            .unwrap_or((Vector2::x(), ReferenceFrame::SceneCenter));
        View { forward, left: Vector2::new(-forward.y, forward.x), frame }
    }

    /// The direction from `place` to the free floor around it, when that lies on one side: what stands against a wall is
    /// looked at from the room. Unit.
    fn find_open_side(&self, place: Point2<f64>) -> Option<Vector2<f64>> {
        const REACH_M: f64 = 1.4;
        const MIN_CELLS: usize = 40;
        const ONE_SIDED: f64 = 0.4;
        let floor = &self.map.free_space;
        if floor.cells.is_empty() {
            return None;
        }
        let [low, high] =
            [-REACH_M, REACH_M].map(|reach| floor.cell_at(&Point2::new(place.x + reach, place.y + reach)));
        let cells = (low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| [x, y]));
        // The floor behind the wall is another room's.
        let room = self.find_room_at(place);
        let own = |at: &Point2<f64>| room.is_none_or(|room| polygon_contains(&room.polygon, at));
        let free = cells.filter(|cell| floor.state(*cell) == CellState::Free).map(|cell| floor.center_of(cell));
        let free = free.filter(own).map(|at| at - place);
        let (mut sum, mut count) = (Vector2::zeros(), 0_usize);
        for offset in free.filter(|offset| (0.05..REACH_M).contains(&offset.norm())) {
            sum += offset.normalize();
            count += 1;
        }
        (count >= MIN_CELLS && sum.norm() > ONE_SIDED * count as f64).then(|| sum.normalize())
    }

    /// The room around a place or, for what hangs on a wall, beside it.
    fn find_room_at(&self, place: Point2<f64>) -> Option<&'a Room> {
        /// Half of what is deepest on a wall, metres.
        const REACH_M: f64 = 0.3;
        let rooms = &self.map.rooms;
        let around = rooms.iter().find(|room| polygon_contains(&room.polygon, &place));
        around.or_else(|| {
            let away = rooms.iter().map(|room| (polygon_distance_m(&room.polygon, &place), room));
            let nearest = away.filter(|(away_m, _)| *away_m < REACH_M).min_by(|a, b| a.0.total_cmp(&b.0));
            nearest.map(|(_, room)| room)
        })
    }

    /// The room an object stands in: as the map says, else by its outline.
    pub(super) fn room_of(&self, item: usize) -> Option<&'a Room> {
        let item = &self.items[item];
        match item.object.room {
            Some(room) => self.room_places.get(&room).map(|place| &self.map.rooms[*place]),
            None => self.map.rooms.iter().find(|room| polygon_contains(&room.polygon, &item.bounds.center().xy())),
        }
    }
}

/// Whether a point lies inside a polygon (even-odd rule).
pub(super) fn polygon_contains(polygon: &[Point2<f64>], point: &Point2<f64>) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        if (a.y > point.y) != (b.y > point.y) && point.x < (b.x - a.x) * (point.y - a.y) / (b.y - a.y) + a.x {
            inside = !inside;
        }
    }
    inside
}

/// Distance in metres from a point to a polygon's outline; infinite for an empty polygon.
pub(super) fn polygon_distance_m(polygon: &[Point2<f64>], point: &Point2<f64>) -> f64 {
    let edges = polygon.iter().enumerate().map(|(i, a)| (a, &polygon[(i + 1) % polygon.len()]));
    let distance = |(a, b): (&Point2<f64>, &Point2<f64>)| {
        let along = b - a;
        let t = ((point - a).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (point - (a + along * t)).norm()
    };
    edges.map(distance).fold(f64::INFINITY, f64::min)
}
