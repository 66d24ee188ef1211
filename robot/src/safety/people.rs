//! How fast the base may be near people.

use super::settings::PeopleSettings;
use dsm::Pose;
use dsm::time::{Span, Stamp};
use nalgebra::{Point2, Point3};

/// People that were seen a moment ago, odometry's frame.
#[derive(Clone, Debug, Default)]
pub(super) struct People {
    seen: Vec<(Stamp, Point2<f64>)>,
}

impl People {
    /// Takes in where people are, base frame; who was seen before is replaced.
    pub(super) fn note(&mut self, stamp: Stamp, people_in_base: &[Point3<f64>], odom_from_base: &Pose) {
        self.seen = people_in_base.iter().map(|person| (stamp, (odom_from_base * person).xy())).collect();
    }

    /// Speed of a base with this footprint and braking beside the nearest person; infinite without one.
    pub(super) fn allowed_m_per_s(
        &self,
        now: Stamp,
        odom_from_base: &Pose,
        radius_m: f64,
        braking_m_per_s2: f64,
        settings: &PeopleSettings,
    ) -> f64 {
        let here = odom_from_base.translation.vector.xy();
        let memory = Span::from_s(settings.memory_s);
        let fresh = self.seen.iter().filter(|(stamp, _)| now - *stamp <= memory);
        let nearest = fresh.map(|(_, person)| (person.coords - here).norm()).fold(f64::INFINITY, f64::min);
        speed_at(nearest - radius_m - settings.person_radius_m, braking_m_per_s2, settings)
    }
}

/// Solves `S = v_h (T + v / a) + v T + v^2 / (2 a) + C` for v.
fn speed_at(separation_m: f64, braking_m_per_s2: f64, settings: &PeopleSettings) -> f64 {
    if separation_m == f64::INFINITY {
        return f64::INFINITY;
    }
    let PeopleSettings { walking_m_per_s, reaction_s, kept_m, slowest_m_per_s, .. } = *settings;
    let way_m = separation_m - kept_m - walking_m_per_s * reaction_s;
    let linear = walking_m_per_s + reaction_s * braking_m_per_s2;
    let speed = -linear + (linear * linear + 2.0 * braking_m_per_s2 * way_m.max(0.0)).sqrt();
    speed.max(slowest_m_per_s)
}

#[cfg(test)]
mod tests {
    //! Contract: the speed fulfils the separation of ISO/TS 15066, grows with the distance, and forgets who has gone.
    use super::*;

    #[test]
    fn the_speed_keeps_the_separation() {
        let settings = PeopleSettings::default();
        let a = 0.7;
        let mut before = 0.0;
        for tenth in 0..60 {
            let separation_m = 0.1 * f64::from(tenth);
            let v = speed_at(separation_m, a, &settings);
            assert!(v >= before, "{separation_m}");
            before = v;
            let needed = settings.walking_m_per_s * (settings.reaction_s + v / a)
                + v * settings.reaction_s
                + v * v / (2.0 * a)
                + settings.kept_m;
            assert!(needed <= separation_m + 1e-9 || v == settings.slowest_m_per_s, "{separation_m}: {v}");
        }
        assert!(before > 0.7, "six metres are far: {before}");
        assert!(speed_at(1.0, a, &settings) < 0.25);
    }

    #[test]
    fn somebody_is_remembered_while_the_base_drives_and_forgotten_after_a_while() {
        let settings = PeopleSettings::default();
        let mut people = People::default();
        let speed = |people: &People, at_s: f64, x_m: f64| {
            people.allowed_m_per_s(Stamp::from_s(at_s), &Pose::translation(x_m, 0.0, 0.0), 0.27, 0.7, &settings)
        };
        assert_eq!(speed(&people, 0.0, 0.0), f64::INFINITY);
        people.note(Stamp(0), &[Point3::new(2.0, 0.0, 1.0)], &Pose::identity());
        assert!(speed(&people, 1.0, 1.0) < speed(&people, 1.0, 0.0));
        assert!(speed(&people, 1.0, -10.0) > 1.0);
        assert_eq!(speed(&people, 3.5, 0.0), f64::INFINITY);
    }
}
