//! What is true of a home, as far as words about it need it.

use dsm::knowledge::Knowledge;
use dsm_sim::scene::{BodyMotion, ObjectSemantics, SceneBody, SceneMaterial, SceneModel, SceneShape, Semantics};
use nalgebra::{Point2, Point3, Vector3};
use std::f64::consts::TAU;

/// A thing stands on what ends this close below it, metres.
const CARRY_GAP_M: f64 = 0.006;
/// What a hand can close around, metres.
const HAND_M: f64 = 0.115;
/// Heights of surfaces on which things are put, metres.
const SURFACE_HEIGHT_M: (f64, f64) = (0.3, 1.0);
/// Categories on which people put things.
const SURFACES: &[&str] = &[
    "table",
    "dining table",
    "coffee table",
    "side table",
    "desk",
    "countertop",
    "cabinet",
    "dresser",
    "nightstand",
    "bench",
    "tv stand",
];

/// Doors between rooms are passed, not asked for.
const DOOR: &str = "door";

/// One object.
#[derive(Clone, Debug)]
pub(super) struct HomeObject {
    pub body: String,
    pub category: String,
    /// Its colour, when it has one and no other shows.
    pub color: Option<String>,
    /// Whether a print, or parts of another colour, make its colour a matter of taste.
    pub mixed: bool,
    pub room: Option<String>,
    /// Its origin in the world, metres.
    pub at: Point3<f64>,
    /// Its outline on the floor: lowest and highest corner, metres.
    pub outline: (Point2<f64>, Point2<f64>),
    pub free: bool,
    /// The object that carries it.
    pub support: Option<usize>,
    /// Whether the hand can take it.
    pub graspable: bool,
    /// Whether it stands on the floor and is more than a rug.
    pub stands: bool,
    /// Whether people put things on it.
    pub is_surface: bool,
}

impl HomeObject {
    /// Distance over the floor from a place to its outline, metres.
    pub(super) fn distance_m(&self, place: &Point2<f64>) -> f64 {
        let (low, high) = self.outline;
        (place - place.sup(&low).inf(&high)).norm()
    }
}

/// All objects and the rooms with a name of their own.
pub(super) struct Home {
    pub objects: Vec<HomeObject>,
    pub rooms: Vec<String>,
}

impl Home {
    pub(super) fn read(model: &SceneModel, semantics: &Semantics) -> Self {
        let listed: Vec<&ObjectSemantics> = semantics.objects.iter().filter(|o| o.category != DOOR).collect();
        let bodies: Vec<&SceneBody> =
            listed.iter().filter_map(|object| model.bodies.iter().find(|body| body.name == object.body)).collect();
        let mut objects: Vec<HomeObject> = Vec::with_capacity(bodies.len());
        for (object, body) in listed.into_iter().zip(&bodies) {
            let at = Point3::from(body.world_from_body.translation.vector);
            let free = body.motion == BodyMotion::Free;
            let printed = matches!(object.pattern.as_deref(), Some("striped" | "checkered" | "dotted"));
            let top_m = top_of(body);
            let stands = at.z.abs() < 0.01 && top_m > 0.1;
            let mixed = printed || stands && is_two_toned(body, &model.materials);
            let takes = object.affordances.iter().any(|a| a == "pick up");
            let surface = SURFACES.contains(&object.category.as_str());
            objects.push(HomeObject {
                body: object.body.clone(),
                category: object.category.clone(),
                color: object.color.clone().filter(|_| !mixed),
                mixed,
                room: semantics.find_room(Point2::new(at.x, at.y)).map(|room| room.name.clone()),
                at,
                outline: outline_of(body),
                free,
                support: bodies.iter().position(|below| free && below.name != body.name && carries(below, &at)),
                graspable: free && takes && object.category != "pillow" && width_of(body) <= HAND_M,
                stands,
                is_surface: surface && (SURFACE_HEIGHT_M.0..=SURFACE_HEIGHT_M.1).contains(&top_m),
            });
        }
        let rooms = semantics.rooms.iter().map(|room| room.name.clone());
        // "bedroom 2" is no name that anybody would say, and leaves "bedroom" ambiguous.
        let numbered = |name: &str| name.ends_with(|c: char| c.is_ascii_digit());
        let all: Vec<String> = rooms.collect();
        let rooms = all
            .iter()
            .filter(|name| !numbered(name) && !all.iter().any(|other| other != *name && other.starts_with(*name)))
            .cloned()
            .collect();
        Self { objects, rooms }
    }

    /// Whether the object may be called by that name: its category, or a wider one.
    pub(super) fn is_called(&self, index: usize, name: &str, knowledge: &Knowledge) -> bool {
        let category = &self.objects[index].category;
        let canonical = knowledge.find_exact(name).map_or(name, |known| known.name.as_str());
        category == name || knowledge.find_exact(category).is_some_and(|known| known.is_a(canonical))
    }

    /// Whether the condition holds for this object and no other.
    pub(super) fn is_only(&self, index: usize, holds: &dyn Fn(usize) -> bool) -> bool {
        (0..self.objects.len()).all(|other| holds(other) == (other == index))
    }

    /// Others of the same category.
    pub(super) fn count_others(&self, index: usize) -> usize {
        self.objects.iter().filter(|other| other.category == self.objects[index].category).count() - 1
    }

    /// Things that stand on it.
    pub(super) fn count_on(&self, index: usize) -> usize {
        self.objects.iter().filter(|object| object.support == Some(index)).count()
    }
}

/// Whether the point lies right on one of the body's level boxes.
fn carries(body: &SceneBody, point_in_world: &Point3<f64>) -> bool {
    let point = body.world_from_body.inverse_transform_point(point_in_world);
    body.geoms.iter().filter(|geom| geom.collides).any(|geom| {
        let SceneShape::Box { half_m } = &geom.shape else { return false };
        let local = geom.body_from_geom.inverse_transform_point(&point);
        let over = local.x.abs() <= half_m.x && local.y.abs() <= half_m.y;
        over && (local.z - half_m.z).abs() <= CARRY_GAP_M
    })
}

/// Whether a part of the surface that catches the eye has another colour than the rest: a white counter with a purple top is
/// as much a white one as a purple one.
fn is_two_toned(body: &SceneBody, materials: &[SceneMaterial]) -> bool {
    /// Share of the surface, and difference in one of red, green and blue.
    const SHARE: f64 = 0.12;
    const DIFFERENCE: f32 = 0.2;
    let areas: Vec<(usize, f64)> =
        body.geoms.iter().filter(|geom| geom.visible).map(|geom| (geom.material, area_m2(&geom.shape))).collect();
    let total_m2: f64 = areas.iter().map(|(_, area_m2)| area_m2).sum();
    let shows = |material: usize| {
        areas.iter().filter(|(of, _)| *of == material).map(|(_, area_m2)| area_m2).sum::<f64>() >= SHARE * total_m2
    };
    let shown: Vec<&SceneMaterial> =
        materials.iter().enumerate().filter(|(index, _)| shows(*index)).map(|(_, material)| material).collect();
    let differ = |a: &SceneMaterial, b: &SceneMaterial| (0..3).any(|i| (a.rgba[i] - b.rgba[i]).abs() > DIFFERENCE);
    shown.iter().enumerate().any(|(index, a)| shown[..index].iter().any(|b| differ(a, b)))
}

/// Surface of a shape of furniture, square metres; 0 for shapes that no furniture is made of.
fn area_m2(shape: &SceneShape) -> f64 {
    match shape {
        SceneShape::Box { half_m: half } => 8.0 * (half.x * half.y + half.y * half.z + half.z * half.x),
        SceneShape::Cylinder { radius_m, half_length_m } => TAU * radius_m * (radius_m + 2.0 * half_length_m),
        SceneShape::Sphere { radius_m } => 2.0 * TAU * radius_m * radius_m,
        SceneShape::Ellipsoid { radii_m } => 2.0 * TAU * radii_m.mean().powi(2),
        _ => 0.0,
    }
}

/// The upright rectangle around a body's solids.
fn outline_of(body: &SceneBody) -> (Point2<f64>, Point2<f64>) {
    let at = body.world_from_body.translation.vector.xy();
    let corners = body.geoms.iter().filter(|geom| geom.collides).map(|geom| {
        let half = match &geom.shape {
            SceneShape::Box { half_m } => *half_m,
            SceneShape::Cylinder { radius_m, half_length_m } => Vector3::new(*radius_m, *radius_m, *half_length_m),
            SceneShape::Sphere { radius_m } => Vector3::repeat(*radius_m),
            SceneShape::Ellipsoid { radii_m } => *radii_m,
            _ => Vector3::zeros(),
        };
        let pose = body.world_from_body * geom.body_from_geom;
        let half = pose.rotation.to_rotation_matrix().matrix().abs() * half;
        let middle = pose.translation.vector;
        (Point2::from((middle - half).xy()), Point2::from((middle + half).xy()))
    });
    let none = (Point2::from(at), Point2::from(at));
    corners.fold(none, |(low, high), corner| (low.inf(&corner.0), high.sup(&corner.1)))
}

/// Height of the highest level box above the floor, metres.
fn top_of(body: &SceneBody) -> f64 {
    let tops = body.geoms.iter().filter(|geom| geom.collides).map(|geom| {
        let half_z = match &geom.shape {
            SceneShape::Box { half_m } => half_m.z,
            SceneShape::Cylinder { half_length_m, .. } => *half_length_m,
            SceneShape::Sphere { radius_m } => *radius_m,
            SceneShape::Ellipsoid { radii_m } => radii_m.z,
            _ => 0.0,
        };
        body.world_from_body.translation.z + geom.body_from_geom.translation.z + half_z
    });
    tops.fold(0.0, f64::max)
}

/// The smaller horizontal extent of the widest solid, metres.
fn width_of(body: &SceneBody) -> f64 {
    let widths = body.geoms.iter().filter(|geom| geom.collides).map(|geom| match &geom.shape {
        SceneShape::Box { half_m } => 2.0 * half_m.x.min(half_m.y),
        SceneShape::Cylinder { radius_m, .. } | SceneShape::Sphere { radius_m } => 2.0 * radius_m,
        SceneShape::Ellipsoid { radii_m } => 2.0 * radii_m.x.min(radii_m.y),
        _ => f64::INFINITY,
    });
    widths.fold(0.0, f64::max)
}
