//! What a drive has seen of each object: by the labels of its images, which stay in this crate.

use super::surface::{BodyPoint, sample};
use crate::camera::{CameraRig, TrueImage, label_of_body};
use crate::scene::{ObjectSemantics, SceneModel, Semantics, WeightClass};
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::eval::{SurfacePoint, TrueAttributes, TrueThing};
use dsm::geometry::{Aabb, upright_box_around};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// A frame counts for an object from this many pixels ...
const LEAST_PX: u32 = 150;
/// ... and when this share of the surface that faces the camera shows.
const LEAST_SHARE: f64 = 0.3;
/// Farther than this a surface is not measured and does not count as seen, metres.
const REACH_M: f32 = 5.0;
/// Difference of depth up to which a point and its pixel are the same place, metres.
const SAME_DEPTH_M: f32 = 0.02;

struct Sighting {
    body: usize,
    object: ObjectSemantics,
    points: Vec<BodyPoint>,
    seen: Vec<bool>,
    corners: Vec<Point3<f64>>,
    /// In the body's frame.
    center: Point3<f64>,
    radius_m: f64,
    frames: u32,
}

/// What has been seen so far.
pub(super) struct Sightings {
    list: Vec<Sighting>,
}

impl Sightings {
    pub(super) fn new(scene: &SceneModel, semantics: &Semantics, rig: &CameraRig) -> Self {
        let surfaces = sample(rig, scene.bodies.len());
        let list = surfaces.into_iter().enumerate().skip(1).filter_map(|(body, (points, corners))| {
            let object = semantics.find_object(&scene.bodies[body].name)?.clone();
            let bounds = Aabb::from_points(&corners)?;
            let (center, radius_m) = (bounds.center(), 0.5 * bounds.size().norm());
            let seen = vec![false; points.len()];
            Some(Sighting { body, object, points, seen, corners, center, radius_m, frames: 0 })
        });
        Self { list: list.collect() }
    }

    /// Counts an image in.
    pub(super) fn note(
        &mut self,
        image: &TrueImage,
        model: &CameraModel,
        world_from_camera: &Pose,
        world_from_bodies: &[Pose],
    ) {
        let mut areas = vec![0u32; world_from_bodies.len() + 1];
        for label in &image.labels {
            if let Some(area) = areas.get_mut(*label as usize) {
                *area += 1;
            }
        }
        let camera_from_world = world_from_camera.inverse();
        self.list.par_iter_mut().for_each(|sighting| {
            let label = label_of_body(sighting.body);
            let area = areas.get(label as usize).copied().unwrap_or(0);
            let Some(world_from_body) = world_from_bodies.get(sighting.body) else { return };
            if area > 0 {
                let share = sighting.look(image, model, &(camera_from_world * world_from_body), label);
                sighting.frames += u32::from(area >= LEAST_PX && share >= LEAST_SHARE);
            }
        });
    }

    /// All objects as they are with the bodies at these poses.
    pub(super) fn into_objects(self, world_from_bodies: &[Pose]) -> Vec<TrueThing> {
        let placed = |sighting: Sighting| {
            let pose = *world_from_bodies.get(sighting.body)?;
            sighting.into_thing(&pose)
        };
        self.list.into_iter().filter_map(placed).collect()
    }
}

impl Sighting {
    /// Marks the points that the image shows; gives the share of the surface facing the camera that it shows.
    fn look(&mut self, image: &TrueImage, model: &CameraModel, camera_from_body: &Pose, label: u32) -> f64 {
        let (center, radius) = (camera_from_body * self.center, self.radius_m);
        if center.z < -radius {
            return 0.0;
        }
        let eye: Point3<f32> = camera_from_body.inverse_transform_point(&Point3::origin()).cast();
        let motion = camera_from_body.cast::<f32>();
        let (mut facing, mut shown) = (0.0, 0.0);
        for (point, seen) in self.points.iter().zip(&mut self.seen) {
            let towards: Vector3<f32> = eye - point.position;
            if point.normal.dot(&towards) <= 0.0 {
                continue;
            }
            facing += f64::from(point.area_m2);
            let p = motion * point.position;
            let Some((column, row)) = model.find_pixel(&p.cast()) else { continue };
            let pixel = (row * model.width + column) as usize;
            if image.labels[pixel] != label {
                continue;
            }
            let depth = image.depth_m[pixel];
            if (depth - p.z).abs() > SAME_DEPTH_M + 0.01 * p.z {
                continue;
            }
            shown += f64::from(point.area_m2);
            *seen |= p.z <= REACH_M;
        }
        if facing > 0.0 { shown / facing } else { 0.0 }
    }

    fn into_thing(self, world_from_body: &Pose) -> Option<TrueThing> {
        let corners: Vec<Point3<f64>> = self.corners.iter().map(|corner| world_from_body * corner).collect();
        let motion = world_from_body.cast::<f32>();
        let points = self.points.iter().zip(&self.seen).map(|(point, seen)| SurfacePoint {
            position: motion * point.position,
            normal: motion.rotation * point.normal,
            area_m2: point.area_m2,
            seen: *seen,
        });
        let object = &self.object;
        Some(TrueThing {
            category: object.category.clone(),
            attributes: TrueAttributes {
                color: object.color.clone(),
                material: object.material.clone(),
                pattern: object.pattern.clone(),
                weight: object.weight_class.map(|class| {
                    match class {
                        WeightClass::Light => "light",
                        WeightClass::Medium => "medium",
                        WeightClass::Heavy => "heavy",
                    }
                    .to_owned()
                }),
                affordances: object.affordances.clone(),
            },
            bounds: upright_box_around(&corners)?,
            points: points.collect(),
            frames_seen: self.frames,
        })
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a point counts as seen when its own pixel shows it, not when something stands before it.
    use super::*;

    #[test]
    fn hidden_points_are_not_seen() {
        let points = (0..10).map(|i| BodyPoint {
            position: Point3::new(0.02 * i as f32 - 0.09, 0.0, 0.0),
            normal: -Vector3::z(),
            area_m2: 1e-4,
        });
        let points: Vec<BodyPoint> = points.collect();
        let mut sighting = Sighting {
            body: 1,
            object: ObjectSemantics::default(),
            seen: vec![false; 10],
            corners: vec![],
            points,
            center: Point3::origin(),
            radius_m: 0.1,
            frames: 0,
        };
        let model = CameraModel::from_vertical_fov(64, 48, 0.5);
        let mut image = TrueImage { width: 64, height: 48, ..TrueImage::default() };
        image.depth_m = vec![1.0; 64 * 48];
        // The right half of the image shows something else.
        image.labels = (0..64 * 48).map(|pixel| if pixel % 64 < 32 { 2 } else { 7 }).collect();
        let share = sighting.look(&image, &model, &Pose::translation(0.0, 0.0, 1.0), 2);
        assert!((share - 0.5).abs() < 1e-9, "{share}");
        assert_eq!(sighting.seen.iter().filter(|seen| **seen).count(), 5);
        image.depth_m.fill(0.5);
        sighting.seen.fill(false);
        assert_eq!(sighting.look(&image, &model, &Pose::translation(0.0, 0.0, 1.0), 2), 0.0);
    }
}
