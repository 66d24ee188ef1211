//! Shadows of one directional light: a map of what it reaches first, kept up to date as things move.
//!
//! ```text
//! instances that stand still ──once──▶ base ─┐
//! instances that moved lately ──each time────┴─▶ map ──four texels per pixel──▶ share of the light that arrives
//! ```
//!
//! A texel of the map is a straight line along the light; it holds how near to the light the last inner side along it
//! is. Drawing the inner sides instead of the outer ones keeps lit surfaces out of their own shadow. Of all that covers a
//! texel the nearest to the light counts, so that the map does not depend on the order in which things moved.

use super::lighting::{Lane, PIECE};
use super::scene::{Light, Scene};
use super::texture::whole_number;
use super::triangle::{Corner, Culling, Outline};
use crate::Pose;
use nalgebra::{Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Side of a texel in metres, unless the scene is so large that the map would grow beyond [`SIDE_MAX`].
const TEXEL_M: f64 = 0.02;
/// Most texels along a side.
const SIDE_MAX: f64 = 1500.0;
/// The map reaches so far beyond what it was made for, metres.
const MARGIN_M: f64 = 0.5;
/// Meshes larger than this do not size the map: floors without end, a sky.
const RADIUS_MAX_M: f32 = 15.0;
/// What stands farther from the middle of the world does not size the map either, metres.
const REACH_M: f64 = 100.0;
/// After so many updates without moving an instance belongs to the base.
const STILL_UPDATES: u32 = 20;
/// Poses are rounded to this, metres and (on the quaternion) half radians: what trembles below it throws the same shadow.
const GRAIN: f64 = 1.0 / 2048.0;
/// What covers a surface by less than this throws no shadow on it, metres.
const BIAS_M: f32 = 0.004;
/// The same on slopes: shares of a texel for each metre of rise.
const SLOPE_TEXELS: f32 = 0.75;
/// No surface is nearer to the light than nothing is.
const NOTHING: f32 = f32::MIN;

/// The map of one light. It belongs to one scene.
#[derive(Clone, Debug)]
pub(super) struct ShadowMap {
    /// Which light of the scene.
    light: usize,
    direction: Vector3<f64>,
    /// Rows: right and down in the map, and away from the light.
    map_from_world: Matrix3<f64>,
    /// Metres in the map's frame.
    corner_m: [f64; 2],
    texel_m: f64,
    width: usize,
    height: usize,
    /// Nearness to the light, minus the metres along it, of the instances that stand still.
    base: Vec<f32>,
    /// The same of all instances.
    nearest: Vec<f32>,
    /// One for each instance of the scene.
    casters: Vec<Caster>,
    corners: Vec<Corner>,
}

#[derive(Clone, Debug)]
struct Caster {
    /// Pose in grains: place, then quaternion.
    grains: [i64; 7],
    still: u32,
    in_base: bool,
    /// Columns and rows of the map that it covers.
    covered: Option<Covered>,
}

#[derive(Clone, Copy, Debug)]
struct Covered {
    columns: [usize; 2],
    rows: [usize; 2],
}

impl ShadowMap {
    /// A map of a light; `None` unless it is directional and something stands there.
    pub(super) fn find(scene: &Scene, light: usize) -> Option<Self> {
        let Some(&Light::Directional { direction_in_world, .. }) = scene.lights.get(light) else { return None };
        let direction: Vector3<f64> = direction_in_world.cast().try_normalize(1e-9)?;
        let aside = if direction.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let right = direction.cross(&aside).normalize();
        let map_from_world =
            Matrix3::from_rows(&[right.transpose(), direction.cross(&right).transpose(), direction.transpose()]);
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for instance in &scene.instances {
            let (center, radius_m) = scene.mesh(instance.mesh).bounding_sphere();
            let place = map_from_world * (instance.world_from_mesh * center.cast::<f64>()).coords;
            if radius_m <= RADIUS_MAX_M && place.norm() <= REACH_M {
                for axis in 0..2 {
                    low[axis] = low[axis].min(place[axis] - f64::from(radius_m));
                    high[axis] = high[axis].max(place[axis] + f64::from(radius_m));
                }
            }
        }
        let size = [0, 1].map(|axis| high[axis] - low[axis] + 2.0 * MARGIN_M);
        if !(size[0] > 0.0 && size[1] > 0.0 && size[0].is_finite() && size[1].is_finite()) {
            return None;
        }
        let texel_m = TEXEL_M.max(size[0].max(size[1]) / SIDE_MAX);
        let [width, height] = size.map(|size| (size / texel_m).ceil() as usize + 2);
        Some(Self {
            light,
            direction,
            map_from_world,
            corner_m: low.map(|low| low - MARGIN_M),
            texel_m,
            width,
            height,
            base: vec![NOTHING; width * height],
            nearest: vec![NOTHING; width * height],
            casters: Vec::new(),
            corners: Vec::new(),
        })
    }

    /// Whether the map is of this light as it shines now.
    pub(super) fn is_of(&self, scene: &Scene, light: usize) -> bool {
        let direction = match scene.lights.get(light) {
            Some(Light::Directional { direction_in_world, .. }) => direction_in_world.cast().try_normalize(1e-9),
            _ => None,
        };
        self.light == light && direction == Some(self.direction) && self.casters.len() == scene.instances.len()
    }

    /// Brings the map up to date with where the instances stand now.
    pub(super) fn update(&mut self, scene: &Scene) {
        if self.casters.len() != scene.instances.len() {
            // The first time everything stands still.
            let still = |pose: &Pose| Caster { grains: grains(pose), still: 0, in_base: true, covered: None };
            self.casters = scene.instances.iter().map(|instance| still(&instance.world_from_mesh)).collect();
            self.rebuild(scene);
            return;
        }
        let (mut moved, mut left_base) = (false, false);
        for (caster, instance) in self.casters.iter_mut().zip(&scene.instances) {
            let grains = grains(&instance.world_from_mesh);
            if !instance.casts_shadow || grains == caster.grains {
                caster.still = caster.still.saturating_add(1);
                continue;
            }
            moved = true;
            left_base |= caster.in_base;
            *caster = Caster { grains, still: 0, in_base: false, covered: caster.covered };
        }
        // What has come to rest joins the base; the map already holds it.
        for index in 0..self.casters.len() {
            let caster = &self.casters[index];
            if !caster.in_base && caster.still >= STILL_UPDATES {
                self.casters[index].in_base = true;
                let mut base = std::mem::take(&mut self.base);
                self.draw(scene, index, &mut base);
                self.base = base;
            }
        }
        if left_base {
            self.rebuild(scene);
        } else if moved {
            self.redraw_moving(scene);
        }
    }

    /// Draws all that stands still, then the rest.
    fn rebuild(&mut self, scene: &Scene) {
        let mut base = std::mem::take(&mut self.base);
        base.fill(NOTHING);
        for index in 0..self.casters.len() {
            if self.casters[index].in_base {
                self.casters[index].covered = self.draw(scene, index, &mut base);
            }
        }
        self.nearest.copy_from_slice(&base);
        self.base = base;
        self.redraw_moving(scene);
    }

    /// Takes what moves off the map and draws it again where it is now.
    fn redraw_moving(&mut self, scene: &Scene) {
        let mut nearest = std::mem::take(&mut self.nearest);
        for caster in self.casters.iter().filter(|caster| !caster.in_base) {
            let Some(Covered { columns, rows }) = caster.covered else { continue };
            for row in rows[0]..rows[1] {
                let span = row * self.width + columns[0]..row * self.width + columns[1];
                nearest[span.clone()].copy_from_slice(&self.base[span]);
            }
        }
        for index in 0..self.casters.len() {
            if !self.casters[index].in_base {
                self.casters[index].covered = self.draw(scene, index, &mut nearest);
            }
        }
        self.nearest = nearest;
    }

    /// Draws the inner sides of an instance; returns what they cover.
    fn draw(&mut self, scene: &Scene, index: usize, map: &mut [f32]) -> Option<Covered> {
        let instance = &scene.instances[index];
        let mesh = scene.mesh(instance.mesh);
        if !instance.casts_shadow || !mesh.is_closed() {
            return None;
        }
        let world_from_mesh = pose_of(&self.casters[index].grains);
        let turn = self.map_from_world * world_from_mesh.rotation.to_rotation_matrix().into_inner();
        let shift = self.map_from_world * world_from_mesh.translation.vector;
        let scale = 1.0 / self.texel_m;
        let texel = |point: &Point3<f32>| {
            let place = turn * point.coords.cast::<f64>() + shift;
            let along = |axis: usize| ((place[axis] - self.corner_m[axis]) * scale) as f32;
            Corner { x: along(0), y: along(1), nearness: -place.z as f32 }
        };
        let (center, radius_m) = mesh.bounding_sphere();
        let (middle, reach) = (texel(&center), (f64::from(radius_m) * scale) as f32 + 1.0);
        // Inside the last texels: beyond them there is light.
        let limits = [self.width - 1, self.height - 1];
        let span = |middle: f32, limit: usize| {
            [
                (middle - reach).clamp(1.0, limit as f32) as usize,
                (middle + reach + 1.0).clamp(1.0, limit as f32) as usize,
            ]
        };
        let covered = Covered { columns: span(middle.x, limits[0]), rows: span(middle.y, limits[1]) };
        if covered.columns[0] >= covered.columns[1] || covered.rows[0] >= covered.rows[1] {
            return None;
        }
        self.corners.clear();
        self.corners.extend(mesh.positions().iter().map(texel));
        let size = limits.map(|limit| limit as u32);
        for corners in mesh.indices() {
            let [a, b, c] = corners.map(|i| i as usize);
            let corners = [&self.corners[a], &self.corners[b], &self.corners[c]];
            let Some(outline) = Outline::find(corners, size, Culling::Front) else { continue };
            let triangle = outline.triangle();
            triangle.for_spans(1, size[1], size[0], |row, from, to| {
                let (start, step) = triangle.nearness_from(from, row);
                let line = row as usize * self.width;
                let texels = &mut map[line + from as usize..line + to as usize];
                for (column, texel) in texels.iter_mut().enumerate() {
                    let nearness = triangle.limit(start + column as i32 as f32 * step);
                    *texel = if nearness > *texel { nearness } else { *texel };
                }
            });
        }
        Some(covered)
    }

    /// The map as one camera looks it up.
    pub(super) fn view(&self, world_from_camera: &Pose) -> (usize, ShadowView<'_>) {
        let turn = self.map_from_world * world_from_camera.rotation.to_rotation_matrix().into_inner();
        let shift = self.map_from_world * world_from_camera.translation.vector;
        let scale = 1.0 / self.texel_m;
        let row = |axis: usize, scale: f64| [0, 1, 2].map(|i| (turn[(axis, i)] * scale) as f32);
        // Half a texel back: a texel's value holds in its middle.
        let start = |axis: usize| ((shift[axis] - self.corner_m[axis]) * scale - 0.5) as f32;
        let view = ShadowView {
            rows: [row(0, scale), row(1, scale), row(2, -1.0)],
            shift: [start(0), start(1), -shift.z as f32],
            slope_m: SLOPE_TEXELS * self.texel_m as f32,
            width: self.width,
            last: [(self.width - 2) as f32, (self.height - 2) as f32],
            nearest: &self.nearest,
        };
        (self.light, view)
    }
}

/// Rounds a pose.
fn grains(pose: &Pose) -> [i64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|value| (value / GRAIN).round() as i64)
}

/// The rounded pose.
fn pose_of(grains: &[i64; 7]) -> Pose {
    let [x, y, z, i, j, k, w] = grains.map(|grains| grains as f64 * GRAIN);
    Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)))
}

/// A shadow map as one camera looks it up.
#[derive(Debug)]
pub(super) struct ShadowView<'a> {
    /// Columns, rows and nearness per metre in the camera frame.
    rows: [[f32; 3]; 3],
    shift: [f32; 3],
    /// Metres of bias on a slope of one.
    slope_m: f32,
    width: usize,
    /// Last column and row that have a neighbour.
    last: [f32; 2],
    nearest: &'a [f32],
}

impl ShadowView<'_> {
    /// The share of the light that arrives at each pixel of a piece, 0 to 1, given depths and cosines to the light.
    #[inline(always)]
    pub(super) fn find_lit(&self, z: &Lane, cos: &Lane, columns: &Lane, row: f32, lit: &mut Lane) {
        if cos.iter().all(|cos| *cos <= 0.0) {
            // What turns away from the light is dark anyway.
            return;
        }
        let (mut offsets, mut limits) = ([0_u32; PIECE], [0.0; PIECE]);
        let (mut right, mut low) = ([0.0; PIECE], [0.0; PIECE]);
        let place = |axis: usize, i: usize| {
            let [x, y, z_share] = self.rows[axis];
            (columns[i] * x + row * y + z_share) * z[i] + self.shift[axis]
        };
        let inside = |value: f32, last: f32| {
            let value = if value > 0.0 { value } else { 0.0 };
            if value < last { value } else { last }
        };
        for i in 0..PIECE {
            let (x, y) = (inside(place(0, i), self.last[0]), inside(place(1, i), self.last[1]));
            let (column, line) = (x.floor(), y.floor());
            offsets[i] = whole_number(line) * self.width as u32 + whole_number(column);
            (right[i], low[i]) = (x - column, y - line);
            // The slope against the light is the tangent, sqrt(1 - cos²) / cos.
            let sin = 1.0 - cos[i] * cos[i];
            let sin = (if sin > 0.0 { sin } else { 0.0 }).sqrt();
            let slope = sin / (cos[i] + 1e-3);
            let slope = if slope < 3.0 { slope } else { 3.0 };
            limits[i] = place(2, i) + BIAS_M + self.slope_m * slope;
        }
        let mut texels = [[0.0; PIECE]; 4];
        for i in 0..PIECE {
            let first = offsets[i] as usize;
            let (upper, lower) = (&self.nearest[first..first + 2], &self.nearest[first + self.width..][..2]);
            (texels[0][i], texels[1][i], texels[2][i], texels[3][i]) = (upper[0], upper[1], lower[0], lower[1]);
        }
        for i in 0..PIECE {
            let [a, b, c, d] = [0, 1, 2, 3].map(|t: usize| if texels[t][i] > limits[i] { 0.0 } else { 1.0 });
            let upper = a + (b - a) * right[i];
            lit[i] = upper + ((c + (d - c) * right[i]) - upper) * low[i];
        }
    }
}
