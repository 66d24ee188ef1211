//! What disturbs generated episodes: something that suits the task, at a moment when it matters.

use super::home::Home;
use super::{Kind, Task};
use dsm_sim::disturb::DisturbanceKind;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Simulated time to get over what happens, beside what the task has, seconds.
const RECOVERY_S: f64 = 180.0;

/// Which disturbances generated episodes get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturb {
    /// One kind in all of them.
    With(DisturbanceKind),
    /// All kinds in turn.
    InTurn,
}

impl std::str::FromStr for Disturb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self::InTurn);
        }
        let known = DisturbanceKind::ALL.iter().find(|kind| kind.name() == text);
        let names = || DisturbanceKind::ALL.map(DisturbanceKind::name).join(", ");
        known.map(|kind| Self::With(*kind)).ok_or_else(|| format!("expected all, or one of: {}", names()))
    }
}

impl Disturb {
    /// The kind whose turn it is.
    pub(super) fn kind_of(self, turn: usize) -> DisturbanceKind {
        match self {
            Self::With(kind) => kind,
            Self::InTurn => DisturbanceKind::ALL[turn % DisturbanceKind::ALL.len()],
        }
    }
}

/// Whether a kind of disturbance means something to a kind of task.
pub(super) fn fits(disturbance: DisturbanceKind, kind: Kind) -> bool {
    match disturbance {
        DisturbanceKind::ObjectMoved | DisturbanceKind::Slip => matches!(kind, Kind::Grasp | Kind::Place),
        DisturbanceKind::ObjectRemoved | DisturbanceKind::Swapped => kind == Kind::Grasp,
        _ => true,
    }
}

/// Whether what happens leaves the words their meaning: what is swapped must be told by its colour, and what is taken away
/// must not leave another one that is "the closest".
pub(super) fn keeps_meaning(disturbance: DisturbanceKind, home: &Home, index: usize, name: &str) -> bool {
    match disturbance {
        DisturbanceKind::Swapped => find_lookalike(home, index, name).is_some(),
        DisturbanceKind::ObjectRemoved => !name.contains(" closest to "),
        _ => true,
    }
}

/// Another thing of the object's kind in another colour, for a name that tells them apart by it alone.
pub(super) fn find_lookalike(home: &Home, index: usize, name: &str) -> Option<usize> {
    let object = &home.objects[index];
    let color = object.color.as_ref()?;
    if name != format!("{color} {}", object.category) {
        return None;
    }
    let like = |other: &usize| {
        let o = &home.objects[*other];
        *other != index && o.category == object.category && o.graspable && o.color.as_ref().is_some_and(|c| c != color)
    };
    (0..home.objects.len()).find(like)
}

impl Task {
    /// Adds a disturbance; whether there is one that suits.
    pub(super) fn disturb(
        &mut self,
        disturbance: DisturbanceKind,
        kind: Kind,
        home: &Home,
        seed: u64,
        number: usize,
    ) -> bool {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ ((number as u64) << 32) ^ 0x6469_7374_7572_6273);
        let early = format!("at_s = {:.1}", 4.0 + 16.0 * rng.random::<f64>());
        let coming = format!("on = \"approaches the object\"\nafter_s = {:.1}", 0.5 + 2.0 * rng.random::<f64>());
        let object = self.body.as_ref().map(|body| format!("\nobject = \"{body}\"")).unwrap_or_default();
        // On the first way through the unknown, or on the way to what is asked for.
        let on_the_way = if kind == Kind::Room || rng.random::<bool>() { early.clone() } else { coming.clone() };
        let when = match disturbance {
            DisturbanceKind::ObjectMoved => coming + &object,
            DisturbanceKind::ObjectRemoved => {
                self.expect = "kind = \"refused\"".into();
                coming + &object
            }
            DisturbanceKind::Slip => "on = \"lifts\"\nafter_s = 0.7".to_owned() + &object,
            DisturbanceKind::Swapped => {
                let index = home.objects.iter().position(|o| Some(&o.body) == self.body.as_ref());
                let name = self.command.split_once(" the ").map_or("", |(_, name)| name);
                let Some(other) = index.and_then(|index| find_lookalike(home, index, name)) else { return false };
                coming + &object + &format!("\nwith = \"{}\"", home.objects[other].body)
            }
            DisturbanceKind::Frames => early + "\nfor_s = 60.0",
            DisturbanceKind::PathBlocked
            | DisturbanceKind::Person
            | DisturbanceKind::WheelSlip
            | DisturbanceKind::LocalisationJump
            | DisturbanceKind::LightOff => on_the_way,
        };
        self.time_limit_s += RECOVERY_S;
        self.disturbance = format!("\n[[disturb]]\nkind = \"{}\"\n{when}\n", disturbance.name());
        true
    }
}
