//! A frame finds its place in the map: what it shows moves with every step of it.

use super::align;
use super::draft::Draft;
use super::drift::{Look, lever};
use super::observation::Observation;
use crate::Pose;
use crate::map::{MapObject, ObjectId, ObjectState};
use nalgebra::{Point3, Vector3, Vector6};

/// A frame's pose with all that is placed by it.
pub(super) struct Placing<'a> {
    world_from_camera: Pose,
    observations: &'a mut [Observation],
    floor: Vec<Point3<f64>>,
    /// Motion so far: along x and y in metres, and of the heading in radians.
    taken: Vector3<f64>,
}

/// What laying a frame onto the map gave.
pub(super) struct Fitted {
    /// Where each object stands beside the frame as the localiser placed it.
    pub(super) looks: Vec<Look>,
    /// How far the camera went, metres.
    pub(super) moved_m: f64,
}

impl<'a> Placing<'a> {
    /// The frame where the localiser believes it.
    pub(super) fn new(world_from_camera: Pose, observations: &'a mut [Observation], floor: Vec<Point3<f64>>) -> Self {
        Self { world_from_camera, observations, floor, taken: Vector3::zeros() }
    }

    pub(super) fn observations(&self) -> &[Observation] {
        self.observations
    }

    pub(super) fn world_from_camera(&self) -> Pose {
        self.world_from_camera
    }

    pub(super) fn eye(&self) -> Point3<f64> {
        self.world_from_camera.translation.vector.into()
    }

    pub(super) fn taken(&self) -> &Vector3<f64> {
        &self.taken
    }

    /// Moves the camera along x and y and turns it about itself, with all that it shows.
    pub(super) fn shift(&mut self, planar: &Vector3<f64>) {
        self.apply(&Vector6::new(planar.x, planar.y, 0.0, 0.0, 0.0, planar.z));
    }

    /// Lays the frame onto the stable objects that it shows and onto the floor; `None` if that cannot be told.
    /// `deviation` is that of what is left of its error.
    pub(super) fn fit(
        &mut self,
        draft: &Draft,
        assigned: &[Option<ObjectId>],
        deviation: &Vector3<f64>,
    ) -> Option<Fitted> {
        let eye = self.eye();
        let stable = |id: ObjectId| draft.find(id).filter(|object| object.state == ObjectState::Stable);
        let pairs = self.observations.iter().zip(assigned);
        let pairs: Vec<(&Observation, &MapObject)> =
            pairs.filter_map(|(observation, id)| Some((observation, stable((*id)?)?))).collect();
        let fit = align::find_correction(&pairs, &self.floor, &eye, deviation)?;
        let ids: Vec<ObjectId> = pairs.iter().map(|(_, object)| object.id).collect();
        self.apply(&fit.motion);
        let look = |left: &align::Left| Look {
            id: ids[left.pair],
            center: left.center,
            offset: left.offset.xy() + lever(&left.center, &eye) * self.taken,
            matches: left.matches,
        };
        let looks = fit.left.iter().map(look).collect();
        Some(Fitted { looks, moved_m: fit.motion.fixed_rows::<3>(0).norm() })
    }

    fn apply(&mut self, motion: &Vector6<f64>) {
        let correction = align::about(&self.eye(), motion);
        self.observations.iter_mut().for_each(|observation| observation.transform(&correction));
        self.floor.iter_mut().for_each(|point| *point = correction * *point);
        self.taken += Vector3::new(motion[0], motion[1], motion[5]);
        self.world_from_camera = correction * self.world_from_camera;
    }
}
