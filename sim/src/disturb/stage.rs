//! When disturbances begin and end, and what they do.

use super::actors::{NOWHERE_M, add_box, add_person};
use super::places::Ground;
use super::walker::{Walker, walkable};
use super::{Disturbance, DisturbanceError, DisturbanceKind};
use crate::physics::Physics;
use crate::scene::{BodyMotion, SceneBody, SceneModel};
use crate::world::{Solids, stream};
use dsm::Pose;
use dsm::map::FreeSpace;
use dsm::time::{Span, Stamp};
use dsm_robot::nav::Costmap;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::mpsc::{Receiver, Sender};

/// Stream of disturbances among all that a seed draws.
const STREAM: u64 = 0x6469_7374_7572_6200;
/// What finds no place is tried again after this long.
const TRY_AGAIN: Span = Span(250_000_000);
/// A base that is faster than this drives, metres per second.
const DRIVES_M_PER_S: f64 = 0.2;
/// A slippery thing has this share of its friction: pads combine it with their own by the geometric mean, so that even a
/// hundredth would hold.
const SLIPPERY: f64 = 0.0;
/// Light that is left when the lights are off: from the street, against a lit room.
const DARK: f32 = 0.004;
/// A jump of the believed pose turns it by so much per metre, radians.
const JUMP_RAD_PER_M: f64 = 0.25;
/// A person leaves only from here on, so that nobody vanishes before the robot's eyes, metres.
const LEAVES_M: f64 = 1.5;

/// Something that was done to the world.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Happening {
    /// When.
    pub(crate) stamp: Stamp,
    /// What, in words.
    pub(crate) what: String,
    /// Bodies that were put elsewhere.
    pub(crate) moved: Vec<usize>,
}

/// What the robot's senses and wheels suffer at present.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    /// Share of the light, 0 to 1.
    pub(crate) light: f32,
    /// Share of frames that are lost.
    pub(crate) lost: f64,
    /// How late the others arrive.
    pub(crate) late: Span,
    /// Share of the wheels' motion that moves the base.
    pub(crate) grip: f64,
    /// What is added to the believed pose: x and y in metres, yaw in radians.
    pub(crate) jump: [f64; 3],
}

impl Default for Conditions {
    fn default() -> Self {
        Self { light: 1.0, lost: 0.0, late: Span(0), grip: 1.0, jump: [0.0; 3] }
    }
}

enum State {
    /// For its time, its words or the robot.
    Waiting,
    Due(Stamp),
    Lasting {
        until: Stamp,
        walker: Option<Walker>,
    },
    Over,
}

struct Item {
    what: Disturbance,
    object: Option<usize>,
    with: Option<usize>,
    actor: Option<usize>,
    rng: ChaCha8Rng,
    state: State,
}

/// Disturbs a world.
pub(crate) struct Disturber {
    items: Vec<Item>,
    heard: Receiver<String>,
    told: Sender<Happening>,
    ground: Ground,
    /// Where people walk, when somebody does.
    floor: Option<Costmap>,
    last: Stamp,
    conditions: Conditions,
}

/// Where words come from and what happens goes.
pub(crate) struct Wires {
    pub(crate) heard: Receiver<String>,
    pub(crate) told: Sender<Happening>,
}

/// Puts what disturbances need into the scene: the bodies of boxes and people, out of the world. One for each disturbance.
pub(crate) fn add_actors(scene: &mut SceneModel, disturbances: &[Disturbance]) -> Vec<Option<usize>> {
    let add = |(number, disturbance): (usize, &Disturbance)| match disturbance.kind {
        DisturbanceKind::PathBlocked => Some(add_box(scene, number)),
        DisturbanceKind::Person => Some(add_person(scene, number)),
        _ => None,
    };
    disturbances.iter().enumerate().map(add).collect()
}

impl Disturber {
    /// For a scene with the actors that [`add_actors`] made; `floor` is where nothing stands at the start.
    pub(crate) fn new(
        disturbances: &[Disturbance],
        actors: &[Option<usize>],
        scene: &SceneModel,
        solids: Solids,
        floor: &FreeSpace,
        seed: u64,
        wires: Wires,
    ) -> Result<Self, DisturbanceError> {
        let find = |kind: DisturbanceKind, name: &Option<String>| -> Result<Option<usize>, DisturbanceError> {
            let Some(name) = name else { return Ok(None) };
            // Only what is moved must be free; a start may be told by anything.
            let fits = |body: &&SceneBody| body.motion == BodyMotion::Free || !kind.needs_object();
            let found = scene.bodies.iter().position(|body| body.name == *name && fits(&body));
            let known = || scene.bodies.iter().skip(1).filter(fits).map(|body| body.name.clone()).collect();
            let missing = || DisturbanceError::NoFreeBody { kind: kind.name(), body: name.clone(), known: known() };
            found.map(Some).ok_or_else(missing)
        };
        let mut items = Vec::new();
        for (index, (what, actor)) in disturbances.iter().zip(actors).enumerate() {
            if let Some(expected) = what.find_flaw() {
                return Err(DisturbanceError::Flawed { kind: what.kind.name(), expected });
            }
            items.push(Item {
                object: find(what.kind, &what.object)?,
                with: find(what.kind, &what.with)?,
                actor: *actor,
                rng: stream(seed, STREAM, index as u64),
                state: State::Waiting,
                what: what.clone(),
            });
        }
        let walks = disturbances.iter().any(|d| d.kind == DisturbanceKind::Person);
        let scene = SceneModel { meshes: Vec::new(), textures: Vec::new(), ..scene.clone() };
        Ok(Self {
            items,
            heard: wires.heard,
            told: wires.told,
            ground: Ground { scene, solids, actors: actors.iter().flatten().copied().collect() },
            floor: walks.then(|| walkable(floor)),
            last: Stamp::default(),
            conditions: Conditions::default(),
        })
    }

    /// Whether bodies are changed while the world runs; the kind that does it.
    pub(crate) fn find_need_of_hands(disturbances: &[Disturbance]) -> Option<DisturbanceKind> {
        disturbances.iter().map(|d| d.kind).find(|kind| kind.needs_hands())
    }

    /// What happens in a control tick.
    pub(crate) fn advance(&mut self, physics: &mut dyn Physics) -> Conditions {
        let now = physics.now();
        let dt_s = (now - self.last).as_s();
        self.last = now;
        let words: Vec<String> = self.heard.try_iter().collect();
        let Self { items, ground, floor, told, conditions, .. } = self;
        for item in items {
            item.wake(physics, now, &words);
            item.act(physics, now, dt_s, ground, floor.as_ref(), told, conditions);
        }
        *conditions
    }
}

impl Item {
    fn wake(&mut self, physics: &dyn Physics, now: Stamp, words: &[String]) {
        let State::Waiting = self.state else { return };
        let near = |within_m: f64, body: usize| {
            let base = physics.world_from_base().translation.vector.xy();
            (physics.world_from_body(body).translation.vector.xy() - base).norm() <= within_m
        };
        let begins = self.what.at_s.is_some_and(|at_s| now.as_s() >= at_s)
            || self.what.on.as_ref().is_some_and(|on| words.iter().any(|what| what.contains(on.as_str())))
            || self.what.within_m.zip(self.object).is_some_and(|(within_m, body)| near(within_m, body));
        if begins {
            self.state = State::Due(now + Span::from_s(self.what.after_s));
        }
    }

    fn act(
        &mut self,
        physics: &mut dyn Physics,
        now: Stamp,
        dt_s: f64,
        ground: &mut Ground,
        floor: Option<&Costmap>,
        told: &Sender<Happening>,
        conditions: &mut Conditions,
    ) {
        match &mut self.state {
            State::Due(at) if now >= *at => {
                let Some((moved, walker)) = self.begin(physics, ground, floor, conditions) else {
                    self.state = State::Due(now + TRY_AGAIN);
                    return;
                };
                self.tell(now, "begins", moved, told);
                self.state = match self.what.lasts_s() {
                    Some(lasts_s) => State::Lasting { until: now + Span::from_s(lasts_s), walker },
                    None => State::Over,
                };
            }
            State::Lasting { until, walker } => {
                if let (Some(walker), Some(actor)) = (walker.as_mut(), self.actor) {
                    let pose = walker.walk(physics, dt_s);
                    put(physics, &[(actor, pose)]);
                }
                let stays = walker.as_ref().is_some_and(|walker| walker.distance_m(physics) < LEAVES_M);
                if now >= *until && !stays {
                    self.end(physics, conditions);
                    self.tell(now, "ends", Vec::new(), told);
                    self.state = State::Over;
                }
            }
            _ => {}
        }
    }

    fn tell(&self, now: Stamp, how: &str, moved: Vec<usize>, told: &Sender<Happening>) {
        let about = self.what.object.as_ref().map_or_else(String::new, |object| format!(" of {object}"));
        let what = format!("{}{about} {how}", self.what.kind.name());
        // Nobody judges any more: then nobody needs to know.
        let _ = told.send(Happening { stamp: now, what, moved });
    }

    /// Begins; the bodies that were put elsewhere, and who walks from now on. `None` when there is no place for it yet.
    fn begin(
        &mut self,
        physics: &mut dyn Physics,
        ground: &mut Ground,
        floor: Option<&Costmap>,
        conditions: &mut Conditions,
    ) -> Option<(Vec<usize>, Option<Walker>)> {
        let mut walker = None;
        let moved = match self.what.kind {
            DisturbanceKind::ObjectMoved => {
                ground.find_elsewhere(physics, self.object?, self.what.by_m, &mut self.rng)?
            }
            DisturbanceKind::ObjectRemoved => vec![(self.object?, Pose::translation(0.0, 0.0, NOWHERE_M))],
            DisturbanceKind::Swapped => ground.find_swapped(physics, self.object?, self.with?)?.to_vec(),
            DisturbanceKind::Slip => {
                physics.hands()?.set_friction_share(self.object?, SLIPPERY);
                Vec::new()
            }
            DisturbanceKind::PathBlocked => {
                if physics.base_velocity().forward_m_per_s < DRIVES_M_PER_S {
                    return None;
                }
                vec![(self.actor?, ground.find_ahead(physics)?)]
            }
            DisturbanceKind::Person => {
                let mut begun = Walker::begin(physics, floor?, &mut self.rng)?;
                let pose = begun.walk(physics, 0.0);
                walker = Some(begun);
                vec![(self.actor?, pose)]
            }
            DisturbanceKind::Frames => {
                (conditions.lost, conditions.late) = (self.what.share, Span::from_s(self.what.late_s));
                Vec::new()
            }
            DisturbanceKind::WheelSlip => {
                conditions.grip = 1.0 - self.what.share;
                Vec::new()
            }
            DisturbanceKind::LocalisationJump => {
                let way: f64 = std::f64::consts::TAU * self.rng.random::<f64>();
                let side = if self.rng.random::<bool>() { 1.0 } else { -1.0 };
                let by_m = self.what.by_m;
                conditions.jump = [by_m * way.cos(), by_m * way.sin(), side * JUMP_RAD_PER_M * by_m];
                Vec::new()
            }
            DisturbanceKind::LightOff => {
                conditions.light = DARK;
                Vec::new()
            }
        };
        put(physics, &moved);
        if self.what.kind == DisturbanceKind::ObjectRemoved {
            physics.hands()?.take_away(self.object?);
        }
        Some((moved.into_iter().map(|(body, _)| body).collect(), walker))
    }

    fn end(&mut self, physics: &mut dyn Physics, conditions: &mut Conditions) {
        let none = Conditions::default();
        match self.what.kind {
            DisturbanceKind::Slip => {
                if let (Some(hands), Some(object)) = (physics.hands(), self.object) {
                    hands.set_friction_share(object, 1.0);
                }
            }
            DisturbanceKind::PathBlocked | DisturbanceKind::Person => {
                if let Some(actor) = self.actor {
                    put(physics, &[(actor, Pose::translation(0.0, 0.0, NOWHERE_M))]);
                }
            }
            DisturbanceKind::Frames => (conditions.lost, conditions.late) = (none.lost, none.late),
            DisturbanceKind::WheelSlip => conditions.grip = none.grip,
            DisturbanceKind::LocalisationJump => conditions.jump = none.jump,
            DisturbanceKind::LightOff => conditions.light = none.light,
            DisturbanceKind::ObjectMoved | DisturbanceKind::ObjectRemoved | DisturbanceKind::Swapped => {}
        }
    }
}

fn put(physics: &mut dyn Physics, moved: &[(usize, Pose)]) {
    if let Some(hands) = physics.hands() {
        moved.iter().for_each(|(body, pose)| hands.put_body(*body, pose));
    }
}
