//! Whether a thing is at rest on a surface.

use super::{find, is_floor, touches, touches_robot};
use dsm::eval::{TrueObject, Truth};

/// Movement in this band counts as resting, metres per second of the body's frame.
const REST_SPEED_M_PER_S: f64 = 0.02;
/// Contacts of a thing at rest come and go with the solver; for so long it rests without one, seconds. What nothing carries
/// falls by 12 mm in the 0.05 s between two samples, and does not rest.
const FLICKER_S: f64 = 0.2;
/// What stands no higher than this above the foot of the surface stands beside it, metres.
const FOOT_M: f64 = 0.02;

/// Follows one thing and one surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    since_s: Option<f64>,
    carried_s: f64,
}

impl Rest {
    /// For how long it has rested, seconds.
    pub(super) fn time_s(&self, now_s: f64) -> f64 {
        self.since_s.map_or(0.0, |since_s| now_s - since_s)
    }

    /// Takes in the next sample; `last` is the one before.
    pub(super) fn follow(&mut self, truth: &Truth, last: Option<&Truth>, body: &str, surface: &str) {
        let now_s = truth.stamp.as_s();
        let is_still = last.and_then(|last| {
            let (before, now) = (find(last, body)?, find(truth, body)?);
            let moved_m = (now.world_from_body.translation.vector - before.world_from_body.translation.vector).norm();
            Some(moved_m / (truth.stamp - last.stamp).as_s().max(1e-6) < REST_SPEED_M_PER_S)
        });
        let is_carried = touches(truth, body, surface) && !stands_beside(truth, body, surface);
        if is_carried {
            self.carried_s = now_s;
        }
        let flickers = self.since_s.is_some() && now_s - self.carried_s <= FLICKER_S + 1e-9;
        let rests = is_still == Some(true) && !touches_robot(truth, body) && (is_carried || flickers);
        self.since_s = rests.then(|| self.since_s.unwrap_or(now_s));
    }
}

/// Whether what touches a surface stands on the floor and leans against it.
fn stands_beside(truth: &Truth, body: &str, surface: &str) -> bool {
    let on_floor = truth
        .contacts
        .iter()
        .any(|c| (c.first == body && is_floor(&c.second)) || (c.second == body && is_floor(&c.first)));
    let low_m = |object: &TrueObject| object.bounds.aabb().min.z;
    let is_low = find(truth, body).zip(find(truth, surface)).is_some_and(|(body, surface)| {
        // A rug is lower than that itself.
        let foot_m = (low_m(surface) + FOOT_M).min(surface.bounds.aabb().max.z - 0.005);
        low_m(body) < foot_m
    });
    on_floor || is_low
}

#[cfg(test)]
mod tests {
    //! Contract: a thing rests on a surface that carries it, though a contact may be missing for a moment; not while it
    //! moves, is held, or stands on the floor beside it.
    use super::*;
    use dsm::eval::TrueContact;
    use dsm::geometry::OrientedBox;
    use dsm::time::Stamp;
    use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

    fn object(body: &str, z_m: f64, height_m: f64, side_m: f64) -> TrueObject {
        TrueObject {
            body: body.into(),
            category: body.into(),
            world_from_body: Isometry3::translation(0.0, 0.0, z_m),
            bounds: OrientedBox {
                center: Point3::new(0.0, 0.0, z_m + 0.5 * height_m),
                size: Vector3::new(side_m, side_m, height_m),
                rotation: UnitQuaternion::identity(),
            },
            free: true,
        }
    }

    fn truth(step: u64, ball_z_m: f64, with: &[&str]) -> Truth {
        let contact = |other: &&str| TrueContact {
            first: "ball".into(),
            second: (*other).into(),
            force_n: 1.0,
            approach_speed_m_per_s: 0.0,
        };
        Truth {
            stamp: Stamp(50_000_000 * step as i64),
            objects: vec![object("ball", ball_z_m, 0.09, 0.09), object("stand", 0.0, 0.5, 0.4)],
            world_from_base: Isometry3::identity(),
            contacts: with.iter().map(contact).collect(),
            clearance_m: None,
            in_view: Vec::new(),
            joints: Vec::new(),
            parts: Vec::new(),
            events: Vec::new(),
        }
    }

    fn rested_s(samples: &[Truth]) -> f64 {
        let mut rest = Rest::default();
        let mut last = None;
        for sample in samples {
            rest.follow(sample, last, "ball", "stand");
            last = Some(sample);
        }
        rest.time_s(samples.last().unwrap().stamp.as_s())
    }

    #[test]
    fn a_contact_that_flickers_is_no_movement() {
        let without = |gone: &[u64]| -> Vec<Truth> {
            (0..=60).map(|i| truth(i, 0.5, if gone.contains(&i) { &[] } else { &["stand"] })).collect()
        };
        assert!(rested_s(&without(&[])) > 2.9);
        assert!(rested_s(&without(&[30])) > 2.9, "one sample without contact");
        assert!(rested_s(&without(&[28, 29, 31])) > 2.9);
        assert!(rested_s(&without(&[28, 29, 30, 31, 32, 33])) < 1.5, "for longer something else carries it");
    }

    #[test]
    fn what_is_held_moves_or_leans_from_the_floor_does_not_rest() {
        let held: Vec<Truth> = (0..=60).map(|i| truth(i, 0.5, &["stand", "robot/finger"])).collect();
        assert!(rested_s(&held) < 1e-9);
        let slides: Vec<Truth> = (0..=60).map(|i| truth(i, 0.5 + 0.002 * i as f64, &["stand"])).collect();
        assert!(rested_s(&slides) < 1e-9);
        let fallen: Vec<Truth> = (0..=60).map(|i| truth(i, 0.0, &["world/floor", "stand"])).collect();
        assert!(rested_s(&fallen) < 1e-9, "it rolled off and lies against the side");
        let on_rug: Vec<Truth> = (0..=60).map(|i| truth(i, 0.01, &["rug", "stand"])).collect();
        assert!(rested_s(&on_rug) < 1e-9);
        let on_low_board: Vec<Truth> = (0..=60).map(|i| truth(i, 0.07, &["stand"])).collect();
        assert!(rested_s(&on_low_board) > 2.9);
    }
}
