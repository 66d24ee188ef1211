//! What disturbed the world, as the truth tells: where things were put, and what the robot did about people.

use crate::summary::{ContactSummary, DisturbanceSummary};
use dsm::Pose;
use dsm::eval::Truth;
use std::collections::BTreeMap;

/// Bodies of people begin with this.
const PERSON: &str = "disturb/person";

/// Follows disturbances through an episode.
#[derive(Default)]
pub(super) struct Disturbed {
    /// Poses of the bodies that were put elsewhere, where they were put last.
    put: BTreeMap<String, Pose>,
    happened: Vec<DisturbanceSummary>,
}

impl Disturbed {
    /// Takes in the next sample.
    pub(super) fn observe(&mut self, truth: &Truth) {
        for event in &truth.events {
            self.happened.push(DisturbanceSummary { at_s: event.stamp.as_s(), what: event.what.clone() });
            for object in truth.objects.iter().filter(|object| event.moved.contains(&object.body)) {
                self.put.insert(object.body.clone(), object.world_from_body);
            }
        }
    }

    /// Where a body was before anything that the robot did: where a disturbance put it, or as at the start.
    pub(super) fn start_of(&self, body: &str, at_start: &Pose) -> Pose {
        self.put.get(body).copied().unwrap_or(*at_start)
    }

    /// What happened.
    pub(super) fn happened(&self) -> Vec<DisturbanceSummary> {
        self.happened.clone()
    }
}

/// The fastest that a contact with a person began, metres per second; `None` without any.
pub(super) fn fastest_with_person(contacts: &[ContactSummary]) -> Option<f64> {
    let people = contacts.iter().filter(|contact| contact.body.starts_with(PERSON));
    people.map(|contact| contact.approach_speed_m_per_s).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    //! Contract: what a disturbance moved begins anew where it was put.
    use super::*;
    use dsm::eval::{TrueEvent, TrueObject};
    use dsm::geometry::OrientedBox;
    use dsm::time::Stamp;
    use nalgebra::{Point3, UnitQuaternion, Vector3};

    #[test]
    fn a_thing_that_was_put_on_a_higher_board_is_not_lifted() {
        let at = |z: f64, events: Vec<TrueEvent>| Truth {
            stamp: Stamp::default(),
            objects: vec![TrueObject {
                body: "mug".into(),
                category: "mug".into(),
                world_from_body: Pose::translation(0.0, 0.0, z),
                bounds: OrientedBox {
                    center: Point3::origin(),
                    size: Vector3::repeat(0.1),
                    rotation: UnitQuaternion::identity(),
                },
                free: true,
            }],
            world_from_base: Pose::identity(),
            contacts: Vec::new(),
            clearance_m: None,
            in_view: Vec::new(),
            joints: Vec::new(),
            parts: Vec::new(),
            events,
        };
        let mut disturbed = Disturbed::default();
        let start = Pose::translation(0.0, 0.0, 0.4);
        disturbed.observe(&at(0.4, Vec::new()));
        assert_eq!(disturbed.start_of("mug", &start), start);
        let swapped = TrueEvent { stamp: Stamp::default(), what: "swapped".into(), moved: vec!["mug".into()] };
        disturbed.observe(&at(0.8, vec![swapped]));
        assert_eq!(disturbed.start_of("mug", &start).translation.z, 0.8);
        assert_eq!(disturbed.start_of("can", &start), start);
        assert_eq!(disturbed.happened().len(), 1);
    }
}
