//! The lights of a scene, and how the seed varies them.

use super::noise::NoiseKey;
use crate::scene::{LightKind, SceneLight};
use dsm::raster::Light;
use nalgebra::{Rotation3, Unit, Vector3};
use rand::RngExt;

/// How much a seed changes the lights of a scene. Each light draws its own values, uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightDraw {
    /// Seed of the run.
    pub seed: u64,
    /// Largest tilt of a directional light in radians; default 0.3, range 0 to 1.
    pub tilt_max_rad: f32,
    /// Largest shift of a point light along each horizontal axis in metres; default 0.3, range 0 to 1.
    pub shift_max_m: f32,
    /// Largest relative change of strength; default 0.2, range 0 to 0.9.
    pub strength_max: f32,
    /// Largest relative change of red against blue, from warm to cold; default 0.06, range 0 to 0.5.
    pub warmth_max: f32,
}

/// Stream of the light among all that a seed draws.
const STREAM: u64 = 0x6c69_6768_7400;
/// Distance at which a point light is half as strong: about the width of a room, since walls throw no shadows.
const RANGE_M: f32 = 3.0;
/// Light that a level surface gets at most from what reaches all rooms: white paper is then nearly white.
const LEVEL_LIGHT_MAX: f32 = 0.95;
/// Light from everywhere when the scene names none: indoors nothing is black.
const AMBIENT_MIN: f32 = 0.3;

impl LightDraw {
    /// The default variation for a seed.
    pub fn new(seed: u64) -> Self {
        Self { seed, tilt_max_rad: 0.3, shift_max_m: 0.3, strength_max: 0.2, warmth_max: 0.06 }
    }

    /// The lights as the scene has them.
    pub fn unchanged() -> Self {
        Self { seed: 0, tilt_max_rad: 0.0, shift_max_m: 0.0, strength_max: 0.0, warmth_max: 0.0 }
    }

    /// Lights and ambient light for the rasteriser.
    pub(super) fn apply(&self, lights: &[SceneLight]) -> (Vec<Light>, [f32; 3]) {
        // A scene without lights gets one from above, a little aslant so that faces differ.
        let fallback = [SceneLight {
            kind: LightKind::Directional { direction: Vector3::new(0.3, 0.45, -0.84) },
            diffuse: [0.6; 3],
            ambient: [AMBIENT_MIN; 3],
            casts_shadow: true,
        }];
        let lights = if lights.is_empty() { &fallback } else { lights };
        let mut rng = NoiseKey { seed: self.seed, stream: STREAM, frame: 0 }.rng(0);
        let mut within = |largest: f32| largest * (2.0 * rng.random::<f32>() - 1.0);
        let mut drawn = Vec::with_capacity(lights.len());
        let mut ambient = [0.0_f32; 3];
        for light in lights {
            let (strength, warmth) = (1.0 + within(self.strength_max), within(self.warmth_max));
            let tint = [1.0 + warmth, 1.0, 1.0 - warmth];
            let shone: [f32; 3] = std::array::from_fn(|i| light.diffuse[i] * strength * tint[i]);
            for (sum, share) in ambient.iter_mut().zip(light.ambient) {
                *sum += share * strength;
            }
            // Both kinds draw the same number of values, so that a changed light leaves the others as they were.
            let (first, second) = (within(1.0), within(1.0));
            drawn.push(match light.kind {
                LightKind::Directional { direction } => {
                    let axis = Unit::try_new(Vector3::new(first, second, 0.0), 1e-6).unwrap_or(Vector3::x_axis());
                    let angle = self.tilt_max_rad * first.abs().max(second.abs());
                    let direction_in_world = Rotation3::from_axis_angle(&axis, angle) * direction;
                    Light::Directional { direction_in_world, color: shone }
                }
                LightKind::Point { position } => {
                    let shift = Vector3::new(first, second, 0.0) * self.shift_max_m;
                    Light::Point { position_in_world: position + shift, color: shone, range_m: RANGE_M }
                }
            });
        }
        let ambient = ambient.map(|light| light.max(AMBIENT_MIN));
        expose(drawn, ambient)
    }
}

/// The light that throws the shadows, by its place among the scene's: the strongest directional one that is meant to. A
/// scene without lights is lit by one that does.
pub(super) fn find_main(lights: &[SceneLight]) -> Option<usize> {
    if lights.is_empty() {
        return Some(0);
    }
    let strength = |light: &SceneLight| light.diffuse.iter().sum::<f32>();
    let throws = |light: &SceneLight| {
        light.casts_shadow && matches!(light.kind, LightKind::Directional { .. }) && strength(light) > 0.0
    };
    let throwing = lights.iter().enumerate().filter(|(_, light)| throws(light));
    // Of two alike the first.
    throwing
        .max_by(|(_, a), (_, b)| strength(a).total_cmp(&strength(b)).then(std::cmp::Ordering::Greater))
        .map(|(i, _)| i)
}

/// A light with a share of its strength.
pub(super) fn dimmed(mut light: Light, share: f32) -> Light {
    let (Light::Directional { color, .. } | Light::Point { color, .. }) = &mut light;
    *color = color.map(|c| c * share);
    light
}

/// Scales all light down where a level surface would be brighter than white.
fn expose(mut lights: Vec<Light>, ambient: [f32; 3]) -> (Vec<Light>, [f32; 3]) {
    let falls = |light: &Light| match *light {
        Light::Directional { direction_in_world, color } => {
            let down = (-direction_in_world.z / direction_in_world.norm().max(1e-9)).max(0.0);
            color.map(|c| c * down)
        }
        Light::Point { .. } => [0.0; 3],
    };
    // Point lights light their own room: the strongest counts.
    let nearest = (lights.iter())
        .filter_map(|light| match *light {
            Light::Point { color, .. } => Some(color.iter().copied().fold(0.0, f32::max)),
            Light::Directional { .. } => None,
        })
        .fold(0.0, f32::max);
    let level = lights.iter().map(falls).fold(ambient, |sum, light| std::array::from_fn(|i| sum[i] + light[i]));
    let brightest = level.iter().copied().fold(0.0, f32::max) + nearest;
    let scale = (LEVEL_LIGHT_MAX / brightest.max(1e-6)).min(1.0);
    for light in &mut lights {
        let (Light::Directional { color, .. } | Light::Point { color, .. }) = light;
        *color = color.map(|c| c * scale);
    }
    (lights, ambient.map(|c| c * scale))
}

#[cfg(test)]
mod tests {
    //! Contract: the seed alone decides the light, different seeds differ, and limits hold.
    use super::*;
    use nalgebra::Point3;

    fn lamp() -> SceneLight {
        let kind = LightKind::Directional { direction: Vector3::new(0.0, 0.0, -1.0) };
        SceneLight { kind, diffuse: [0.4; 3], ambient: [0.1; 3], casts_shadow: true }
    }

    #[test]
    fn a_seed_draws_light_within_its_limits() {
        let mut seen = Vec::new();
        for seed in 0..40 {
            let (lights, ambient) = LightDraw::new(seed).apply(&[lamp()]);
            assert_eq!((&lights, ambient), (&LightDraw::new(seed).apply(&[lamp()]).0, [AMBIENT_MIN; 3]));
            let Light::Directional { direction_in_world, color } = lights[0] else { panic!("kept its kind") };
            assert!(direction_in_world.angle(&-Vector3::z()) <= 0.3 + 1e-5);
            assert!(color.iter().all(|c| (0.4 * 0.8 * 0.93..0.4 * 1.2 * 1.07).contains(c)), "{color:?}");
            seen.push(direction_in_world);
        }
        assert!(seen.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(seen.iter().any(|d| d.angle(&-Vector3::z()) > 0.15));
    }

    #[test]
    fn unchanged_light_is_the_scenes_own_and_too_much_is_scaled() {
        let (lights, _) = LightDraw::unchanged().apply(&[lamp()]);
        assert_eq!(lights, [Light::Directional { direction_in_world: -Vector3::z(), color: [0.4; 3] }]);
        let (lights, ambient) = LightDraw::unchanged().apply(&[lamp(); 9]);
        let sum: f32 =
            lights.iter().map(|l| if let Light::Directional { color, .. } = l { color[0] } else { 0.0 }).sum();
        assert!((sum + ambient[0] - LEVEL_LIGHT_MAX).abs() < 1e-4);
        assert_eq!(LightDraw::unchanged().apply(&[]).0.len(), 1);
    }

    #[test]
    fn the_strongest_directional_light_that_may_throws_the_shadows() {
        let soft = SceneLight { casts_shadow: false, diffuse: [0.9; 3], ..lamp() };
        let bulb = SceneLight { kind: LightKind::Point { position: Point3::origin() }, diffuse: [0.9; 3], ..lamp() };
        let sun = SceneLight { diffuse: [0.5; 3], ..lamp() };
        assert_eq!(find_main(&[lamp(), soft, bulb, sun, sun]), Some(3));
        assert_eq!(find_main(&[soft, bulb]), None);
        assert_eq!(find_main(&[]), Some(0));
    }
}
