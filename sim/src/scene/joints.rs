//! Doors, drawers and lids: bodies that move on a joint against what carries them.

use super::model::{BodyMotion, SceneGeom, SceneModel};
use dsm::Pose;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// The one motion that a joint leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointMotion {
    /// Turning about the axis; positions in radians, efforts in newton metres.
    Hinge,
    /// Sliding along the axis; positions in metres, efforts in newtons.
    Slide,
}

/// A joint between two bodies of a scene. Nothing drives it.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneJoint {
    /// Its name; that of its body when the scene gives it none.
    pub name: String,
    /// Index of the body that it moves.
    pub part: usize,
    /// Index of the body that carries it, before `part` when that moves, too.
    pub carrier: usize,
    /// How it moves.
    pub motion: JointMotion,
    /// Its frame in the carrier, z along the axis.
    pub carrier_from_joint: Pose,
    /// Its frame in the part; on the one in the carrier where the joint is at `reference`.
    pub part_from_joint: Pose,
    /// The position (radians or metres) at which the two frames are one.
    pub reference: f64,
    /// Least and greatest position; `None` when it has no end.
    pub range: Option<[f64; 2]>,
    /// Effort against each unit of speed.
    pub damping: f64,
    /// Greatest effort of dry friction.
    pub friction: f64,
    /// Effort of a spring for each unit of distance from `spring_reference`.
    pub stiffness: f64,
    /// Position at which the spring is at rest.
    pub spring_reference: f64,
    /// Inertia of what turns or moves with the joint besides the part, kg m^2 or kg.
    pub armature: f64,
}

impl SceneJoint {
    /// The displaced joint frame in the joint frame of the carrier.
    pub fn displacement(&self, position: f64) -> Pose {
        let by = position - self.reference;
        match self.motion {
            JointMotion::Hinge => {
                Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), by))
            }
            JointMotion::Slide => Pose::translation(0.0, 0.0, by),
        }
    }

    /// Pose of the part in its carrier at a position.
    pub fn carrier_from_part(&self, position: f64) -> Pose {
        self.carrier_from_joint * self.displacement(position) * self.part_from_joint.inverse()
    }

    /// Position at which the part is, given the poses of both bodies. An angle is the one nearest to the middle of the range.
    pub fn find_position(&self, world_from_carrier: &Pose, world_from_part: &Pose) -> f64 {
        let moved = (world_from_carrier * self.carrier_from_joint).inv_mul(&(world_from_part * self.part_from_joint));
        match self.motion {
            JointMotion::Slide => self.reference + moved.translation.z,
            JointMotion::Hinge => {
                let angle = self.reference + 2.0 * moved.rotation.k.atan2(moved.rotation.w);
                let middle = self.range.map_or(self.reference, |[low, high]| 0.5 * (low + high));
                angle - TAU * ((angle - middle + PI) / TAU).floor()
            }
        }
    }
}

impl SceneModel {
    /// The joint that moves a body.
    pub fn find_joint(&self, part: usize) -> Option<&SceneJoint> {
        self.joints.iter().find(|joint| joint.part == part)
    }

    /// Position of a joint as the scene stands.
    pub fn joint_position(&self, joint: &SceneJoint) -> f64 {
        let [carrier, part] = [joint.carrier, joint.part].map(|body| self.bodies[body].world_from_body);
        joint.find_position(&carrier, &part)
    }

    /// Where a moving part is in its carrier as the scene stands.
    pub fn standing_part(&self, joint: &SceneJoint) -> Pose {
        let [carrier, part] = [joint.carrier, joint.part].map(|body| self.bodies[body].world_from_body);
        carrier.inv_mul(&part)
    }

    /// Whether a body hangs on another one, directly or not.
    pub fn hangs_on(&self, body: usize, on: usize) -> bool {
        let mut next = Some(body);
        while let Some(at) = next {
            if at == on {
                return true;
            }
            next = self.find_joint(at).map(|joint| joint.carrier);
        }
        false
    }

    /// The body that carries another one in the end: itself unless it moves on a joint.
    pub fn find_root(&self, body: usize) -> usize {
        self.find_joint(body).map_or(body, |joint| self.find_root(joint.carrier))
    }

    /// The same scene with all joints held fast where they are: what moves is a part of what carries it. For those who want
    /// to know what stands where, not what can move.
    pub fn with_joints_held(&self) -> Self {
        let mut held = Self { joints: Vec::new(), ..self.clone() };
        for joint in &self.joints {
            let root = self.find_root(joint.part);
            let [root_pose, part_pose] = [root, joint.part].map(|body| self.bodies[body].world_from_body);
            let root_from_part = root_pose.inv_mul(&part_pose);
            let geoms = std::mem::take(&mut held.bodies[joint.part].geoms).into_iter();
            let geoms = geoms.map(|geom| SceneGeom { body_from_geom: root_from_part * geom.body_from_geom, ..geom });
            held.bodies[root].geoms.extend(geoms);
        }
        let moves = |body: usize| self.bodies[body].motion == BodyMotion::Jointed;
        held.ties.retain(|tie| !tie.bodies.iter().any(|body| moves(*body)));
        held.excluded.retain(|pair| !pair.iter().any(|body| moves(*body)));
        held.bodies.retain(|body| body.motion != BodyMotion::Jointed);
        held
    }
}

#[cfg(test)]
mod tests {
    //! Contract: poses and positions of a joint are two ways to say the same.
    use super::*;

    #[test]
    fn a_position_comes_back_from_the_poses() {
        let turned = UnitQuaternion::from_euler_angles(0.3, -0.4, 1.1);
        for (motion, range) in [(JointMotion::Hinge, [-5.0, 0.0]), (JointMotion::Slide, [0.0, 0.5])] {
            let joint = SceneJoint {
                name: "j".into(),
                part: 2,
                carrier: 1,
                motion,
                carrier_from_joint: Pose::from_parts(Translation3::new(0.1, 0.2, 0.3), turned),
                part_from_joint: Pose::from_parts(Translation3::new(-0.2, 0.0, 0.1), turned.inverse()),
                reference: 0.2,
                range: Some(range),
                damping: 0.0,
                friction: 0.0,
                stiffness: 0.0,
                spring_reference: 0.0,
                armature: 0.0,
            };
            let carrier = Pose::from_parts(Translation3::new(4.0, -2.0, 0.5), turned * turned);
            for step in 0..=10 {
                let position = range[0] + (range[1] - range[0]) * f64::from(step) / 10.0;
                let found = joint.find_position(&carrier, &(carrier * joint.carrier_from_part(position)));
                assert!((found - position).abs() < 1e-9, "{motion:?} at {position}: {found}");
            }
        }
    }
}
