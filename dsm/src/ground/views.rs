//! Views of a candidate, rendered from the map's own points: object, place and scene level.

use crate::camera::CameraModel;
use crate::geometry::Aabb;
use crate::map::{Map, MapObject, ObjectId};
use crate::raster::{Image, RenderOptions, Renderer, Scene, Splats, look_at};
use nalgebra::{Point3, Vector3};

/// Width and height of every view in pixels.
const SIZE: (u32, u32) = (160, 120);
/// Full vertical angle of view in radians.
const FOV_RAD: f64 = 0.9;
/// The place level shows what lies this far around the candidate, metres.
const PLACE_REACH_M: f64 = 1.2;
/// Angle of the camera above the horizon in radians.
const ELEVATION_RAD: f64 = 0.6;
/// Directions around the candidate that are tried.
const AZIMUTHS: usize = 6;
/// Points of the candidate and of others in the views: enough to close the surface of a cup at this size.
const MAX_POINTS: [usize; 2] = [1_500, 300];
/// Points of the candidate and of others while the best side is looked for.
const MAX_SIDE_POINTS: [usize; 2] = [300, 80];
/// Points per object in the scene view.
const MAX_SCENE_POINTS: [usize; 2] = [150, 150];

/// Which views are rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Levels {
    /// The candidate, and it among its neighbours; the scene view stays empty.
    Near,
    /// The whole map as well.
    All,
}

/// What can be seen of a candidate. Labels are positions in `shown` + 1.
#[derive(Clone, Debug)]
pub struct CandidateViews {
    /// Objects by label - 1; the candidate is the first. Only those that are shown at the levels that were asked for.
    pub shown: Vec<ObjectId>,
    /// Object level: the candidate fills the view.
    pub object: Image,
    /// Place level: the candidate among its neighbours and anchors, from the same side.
    pub place: Image,
    /// Scene level: the whole map from above; without pixels when it was not asked for.
    pub scene: Image,
}

impl CandidateViews {
    /// Renders the three views of a candidate; `None` when the map has no points of it.
    pub fn render(map: &Map, candidate: &MapObject, anchors: &[&MapObject], renderer: &mut Renderer) -> Option<Self> {
        Self::render_levels(map, candidate, anchors, Levels::All, renderer)
    }

    /// As [`render`](Self::render), only the levels that are needed.
    pub fn render_levels(
        map: &Map,
        candidate: &MapObject,
        anchors: &[&MapObject],
        levels: Levels,
        renderer: &mut Renderer,
    ) -> Option<Self> {
        if candidate.points.is_empty() {
            return None;
        }
        let own = candidate.bounds.aabb();
        let around = anchors.iter().fold(own.grown(PLACE_REACH_M * 0.5), |b, anchor| {
            let anchor = anchor.bounds.aabb();
            Aabb { min: b.min.inf(&anchor.min), max: b.max.sup(&anchor.max) }
        });
        let reach = own.grown(PLACE_REACH_M);
        let others = map.stable_objects().filter(|object| object.id != candidate.id);
        let (near, far): (Vec<&MapObject>, Vec<&MapObject>) = others.partition(|object| reaches(&reach, object));
        let mut shown = vec![candidate];
        shown.extend(near);
        let close = scene_of(&shown, MAX_POINTS);
        let eye_side = best_side(&scene_of(&shown, MAX_SIDE_POINTS), &own, renderer);
        let object = view(&close, &own, eye_side, renderer);
        let place = view(&close, &around, eye_side, renderer);
        if levels == Levels::Near {
            let shown = shown.iter().map(|object| object.id).collect();
            return Some(Self { shown, object, place, scene: Image::default() });
        }
        let all = [&shown[..], &far[..]].concat();
        let bounds = all.iter().fold(own, |b, object| {
            let other = object.bounds.aabb();
            Aabb { min: b.min.inf(&other.min), max: b.max.sup(&other.max) }
        });
        let from_above = Vector3::new(0.25, 0.0, 1.0).normalize();
        let scene = view(&scene_of(&all, MAX_SCENE_POINTS), &bounds, from_above, renderer);
        Some(Self { shown: all.iter().map(|object| object.id).collect(), object, place, scene })
    }

    /// Number of pixels of an object in a view of this set.
    pub fn pixel_count(&self, view: &Image, id: ObjectId) -> usize {
        let label = self.shown.iter().position(|shown| *shown == id).map(|i| i as u32 + 1);
        label.map_or(0, |label| view.labels.iter().filter(|seen| **seen == label).count())
    }
}

/// Whether the box around an object meets `reach`. Most of a large map lies farther away than the object's diagonal, which
/// is told without turning its corners.
fn reaches(reach: &Aabb, object: &MapObject) -> bool {
    let (center, diagonal_m) = (object.bounds.center, object.bounds.size.norm());
    let apart = |i: usize| center[i] + diagonal_m < reach.min[i] || center[i] - diagonal_m > reach.max[i];
    !(0..3).any(apart) && reach.find_intersection(&object.bounds.aabb()).is_some()
}

/// The first object with at most the first number of points, the others with the second.
fn scene_of(objects: &[&MapObject], [own_points, other_points]: [usize; 2]) -> Scene {
    let splats = |(i, object): (usize, &&MapObject)| {
        let max_points = if i == 0 { own_points } else { other_points };
        let stride = object.points.len().div_ceil(max_points).max(1);
        let points = || object.points.iter().step_by(stride);
        // Points stand for the surface between them: wider apart, larger.
        let size = object.bounds.size;
        let surface_m2 = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let spacing_m = (surface_m2 / points().count().max(1) as f64).sqrt();
        Splats {
            points_in_world: points().map(|p| p.position).collect(),
            colors: points().map(|p| p.color).collect(),
            radius_m: (0.7 * spacing_m).clamp(0.003, 0.05) as f32,
            label: i as u32 + 1,
        }
    };
    let mut scene = Scene::default();
    scene.splats = objects.iter().enumerate().map(splats).collect();
    scene
}

/// The direction from the candidate to the camera from which most of it is seen; ties go to the first.
fn best_side(scene: &Scene, bounds: &Aabb, renderer: &mut Renderer) -> Vector3<f64> {
    let side = |i: usize| {
        let azimuth = i as f64 / AZIMUTHS as f64 * std::f64::consts::TAU;
        let level = ELEVATION_RAD.cos();
        Vector3::new(level * azimuth.cos(), level * azimuth.sin(), ELEVATION_RAD.sin())
    };
    let mut best = (0, side(0));
    for i in 0..AZIMUTHS {
        let model = CameraModel::from_vertical_fov(SIZE.0 / 4, SIZE.1 / 4, FOV_RAD);
        let image = shoot(scene, &model, bounds, side(i), renderer);
        let seen = image.labels.iter().filter(|label| **label == 1).count();
        if seen > best.0 {
            best = (seen, side(i));
        }
    }
    best.1
}

fn view(scene: &Scene, bounds: &Aabb, side: Vector3<f64>, renderer: &mut Renderer) -> Image {
    shoot(scene, &CameraModel::from_vertical_fov(SIZE.0, SIZE.1, FOV_RAD), bounds, side, renderer)
}

/// A picture of all of `bounds` from `side`.
fn shoot(scene: &Scene, model: &CameraModel, bounds: &Aabb, side: Vector3<f64>, renderer: &mut Renderer) -> Image {
    let radius_m = (0.5 * bounds.size().norm()).max(0.03);
    let target: Point3<f64> = bounds.center();
    let eye = target + side * (radius_m / (0.5 * FOV_RAD).sin());
    renderer.render(scene, model, &look_at(&eye, &target), &RenderOptions::default())
}

#[cfg(test)]
mod tests {
    //! Contract: the candidate fills its object view in its own colours, and its anchor is seen with it at place level.
    use super::*;
    use crate::ground::tests::house::{map_of, thing};
    use crate::map::ObjectId;

    #[test]
    fn the_levels_show_object_place_and_scene() {
        let map = map_of([
            thing(1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]).points([120, 80, 40]),
            thing(2, "apple", [2.2, 0.1, 0.79], [0.08, 0.08, 0.08]).points([190, 30, 30]),
            thing(3, "sofa", [2.0, 4.0, 0.4], [2.0, 0.9, 0.8]).points([130, 130, 130]),
        ]);
        let object = |id| map.find_object(ObjectId(id)).unwrap();
        let views = CandidateViews::render(&map, object(2), &[object(1)], &mut Renderer::default()).unwrap();
        let share = |image: &Image, id| views.pixel_count(image, ObjectId(id)) as f64 / image.labels.len() as f64;
        if let Ok(folder) = std::env::var("DSM_TEST_VIEWS") {
            for (name, image) in [("object", &views.object), ("place", &views.place), ("scene", &views.scene)] {
                let file = std::fs::File::create(format!("{folder}/{name}.png")).unwrap();
                let mut png = png::Encoder::new(file, image.width, image.height);
                png.set_color(png::ColorType::Rgb);
                let bytes: Vec<u8> = image.color.iter().flatten().copied().collect();
                png.write_header().unwrap().write_image_data(&bytes).unwrap();
            }
        }
        assert!(share(&views.object, 2) > 0.15, "{}", share(&views.object, 2));
        assert!(share(&views.place, 1) > 0.1 && share(&views.place, 2) > 0.0005);
        assert!([1, 2, 3].into_iter().all(|id| share(&views.scene, id) > 0.0));
        let red = views.object.labels.iter().zip(&views.object.color).filter(|(label, _)| **label == 1);
        assert!(red.clone().filter(|(_, c)| c[0] > 150 && c[1] < 60).count() * 10 > 9 * red.count());
    }
}
