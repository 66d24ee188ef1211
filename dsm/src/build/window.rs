//! The geometry sliding window: an object's shape as voxels on which its recent views vote.
//!
//! Each view is a frustum with a coarse depth image. A voxel keeps how many views of the window could see it (`chances`)
//! and how many of them measured the object there (`hits`); a hidden place is no chance. The surface is what enough
//! chances agree on. Counts are kept up to date by adding the newest view and taking the evicted one back, so one
//! observation costs two tests per voxel, however long the window is.

use super::bounds::{Seen, upright_box};
use super::config::BuildConfig;
use super::observation::{depth_noise_m, robust_aabb};
use super::view::{Evidence, View};
use crate::geometry::{Aabb, OrientedBox};
use crate::map::MapPoint;
use nalgebra::{Isometry3, Point3, Translation3, Vector2, Vector3};

/// Tolerance of a voxel test beside the voxel's size and the depth noise: the pose error within the window, metres.
const POSE_TOLERANCE_M: f32 = 0.015;
/// Weight averaged into a voxel before newer points push older ones out.
const MEMORY: f32 = 32.0;
/// Share of the mean weight that a voxel of a small thing needs: depth noise spreads a thin fringe around a surface that is
/// measured often.
const FRINGE: f32 = 0.3;
/// The same for larger things, whose far parts are seen seldom without being wrong.
const LARGE_FRINGE: f32 = 0.05;

/// Share of the views that must end at the image's upper edge for the thing to count as cut off there.
const CUT_SHARE: f64 = 0.7;
/// Points of another thing that are looked at in each view.
const COVER_SAMPLES: usize = 24;

#[derive(Clone, Debug)]
struct Voxel {
    key: [i32; 3],
    position: Point3<f32>,
    color: [f32; 3],
    /// Sum of the weights of its points, at most [`MEMORY`].
    weight: f32,
    /// The same without a limit: of two voxels in one line of sight the surface is where most was measured.
    mass: f32,
    /// New in this frame: not yet tested against the window.
    fresh: bool,
    /// Views that agree, with one for what was known before the window.
    hits: u16,
    chances: u16,
    /// 1 if it was known before the window (an evicted view or a loaded map).
    remembered: u16,
}

/// The window of one object.
#[derive(Clone, Debug)]
pub(super) struct Window {
    voxel_m: f32,
    /// Where the voxels' grid begins: it moves with the object.
    origin: Vector3<f32>,
    /// Sorted by key.
    voxels: Vec<Voxel>,
    /// Oldest first.
    views: Vec<View>,
}

/// Shape read off a window.
pub(super) struct Shape {
    pub(super) points: Vec<MapPoint>,
    pub(super) bounds: OrientedBox,
    pub(super) aabb: Aabb,
    /// Heights of its upward faces in metres, rising; the top is the last.
    pub(super) surfaces: Vec<f64>,
    /// What the best view lost of the outline, metres.
    pub(super) lost_m: f64,
}

impl Window {
    /// An empty window for a thing of this size.
    pub(super) fn new(extent: &Aabb) -> Self {
        Self { voxel_m: voxel_size_m(extent), origin: Vector3::zeros(), voxels: Vec::new(), views: Vec::new() }
    }

    /// A window that remembers points without their views.
    pub(super) fn from_points(points: &[MapPoint], extent: &Aabb) -> Self {
        let mut window = Self::new(extent);
        window.insert(points, |_| 1.0, 1);
        window.voxels.iter_mut().for_each(|v| v.fresh = false);
        window
    }

    /// Bytes of its voxels.
    pub(super) fn voxel_bytes(&self) -> usize {
        self.voxels.capacity() * size_of::<Voxel>()
    }

    /// Its views, oldest first.
    pub(super) fn views(&self) -> &[View] {
        &self.views
    }

    /// Moves all that it knows.
    pub(super) fn shift(&mut self, by: &Vector3<f32>) {
        self.origin += by;
        self.voxels.iter_mut().for_each(|voxel| voxel.position += by);
        let motion = Isometry3::from(Translation3::from(*by));
        self.views.iter_mut().for_each(|view| view.transform(&motion));
    }

    /// Adds a view with its points and evicts what exceeds the window. Points count by the square of their accuracy.
    pub(super) fn add(&mut self, config: &BuildConfig, view: View, points: &[MapPoint], center: &Point3<f64>) {
        if !config.window {
            self.insert(points, |_| 1.0, 1);
            self.voxels.iter_mut().for_each(|v| v.fresh = false);
            if self.voxels.len() > 3 * config.max_points {
                self.coarsen(self.voxel_m * 2.0);
            }
            return;
        }
        self.testify(&view, 1);
        let distance_m = (view.eye.cast::<f64>() - center).norm();
        let accuracy = depth_noise_m(0.0) / depth_noise_m(distance_m);
        self.insert(points, |_| (accuracy * accuracy) as f32, 0);
        self.views.push(view);
        let (voxel_m, views) = (self.voxel_m, &self.views);
        let origin = self.origin;
        self.voxels.iter_mut().filter(|v| v.fresh).for_each(|v| {
            views.iter().for_each(|view| count(v, view, (&origin, voxel_m), 1));
            v.fresh = false;
        });
        self.evict(config, center);
        if self.voxels.len() > 3 * config.max_points {
            self.coarsen(self.voxel_m * 2.0);
        }
    }

    /// Takes over all that another window knows.
    pub(super) fn absorb(&mut self, config: &BuildConfig, other: Self, center: &Point3<f64>) {
        let (points, masses) = other.kept_points(config);
        if other.voxel_m > self.voxel_m {
            self.coarsen(other.voxel_m);
        }
        self.insert(&points, |index| masses[index], 1);
        self.voxels.iter_mut().for_each(|v| v.fresh = false);
        self.views.extend(other.views);
        self.views.sort_by_key(|view| view.frame);
        self.recount();
        self.evict(config, center);
    }

    /// The surface that enough views agree on; `None` when nothing is left.
    ///
    /// `depth_m` is the usual depth of such things, see [`upright_box`].
    pub(super) fn find_shape(&mut self, config: &BuildConfig, depth_m: Option<f64>) -> Option<Shape> {
        let (mut points, mut masses) = self.kept_points(config);
        let aabb = robust_aabb(&points)?;
        let wanted = voxel_size_m(&aabb);
        if wanted > self.voxel_m {
            self.coarsen(wanted);
            (points, masses) = self.kept_points(config);
        }
        let seen = self.seen(&aabb);
        let bounds = upright_box((&points, &masses), &aabb, f64::from(self.voxel_m), &seen, depth_m)?;
        let surfaces = find_surfaces((&points, &masses), &bounds, f64::from(self.voxel_m));
        if points.len() > config.max_points {
            let step = points.len() as f64 / config.max_points as f64;
            points = (0..config.max_points).map(|i| points[(i as f64 * step) as usize]).collect();
        }
        Some(Shape { points, bounds, aabb, surfaces, lost_m: seen.lost_m })
    }

    /// From where the views of the window look at a thing.
    fn seen(&self, aabb: &Aabb) -> Seen {
        let center = aabb.center();
        let towards = |view: &View| (view.eye.cast::<f64>() - center).xy().try_normalize(1e-6);
        let sum = self.views.iter().filter_map(towards).fold(Vector2::zeros(), |sum, direction| sum + direction);
        let above = |view: &View| if f64::from(view.eye.z) >= center.z { 1.0 } else { -1.0 };
        let lost_m = self.views.iter().map(|view| view.lost_m).fold(f32::INFINITY, f32::min);
        let count = self.views.len().max(1) as f64;
        Seen {
            towards: sum / count,
            above: self.views.iter().map(above).sum::<f64>() / count,
            lost_m: if lost_m.is_finite() { f64::from(lost_m) } else { 0.0 },
            cut_above: self.views.iter().filter(|view| view.cut_above).count() as f64 > CUT_SHARE * count,
        }
    }

    /// Share of the views, among those that look at the points, in whose mask at least half of what they see of them lies;
    /// with the number of such views.
    pub(super) fn cover(&self, points: &[MapPoint]) -> (f64, usize) {
        let (mut looking, mut covering) = (0, 0);
        for view in &self.views {
            let (mut inside, mut outside) = (0, 0);
            for point in points.iter().step_by(points.len().div_ceil(COVER_SAMPLES).max(1)) {
                match view.testify(&point.position, POSE_TOLERANCE_M + self.voxel_m) {
                    Evidence::Agrees => inside += 1,
                    Evidence::Denies => outside += 1,
                    Evidence::Silent => {}
                }
            }
            if 4 * (inside + outside) >= COVER_SAMPLES.min(points.len()) {
                looking += 1;
                covering += usize::from(inside >= outside);
            }
        }
        (f64::from(covering as u32) / f64::from(looking.max(1) as u32), looking)
    }

    /// Points of the voxels that enough views agree on and that are no fringe; with their masses.
    fn kept_points(&self, config: &BuildConfig) -> (Vec<MapPoint>, Vec<f32>) {
        let kept = || self.voxels.iter().filter(|v| is_kept(v, config));
        let (sum, count) = kept().fold((0.0, 0), |(sum, count), v| (sum + v.weight, count + 1));
        let fringe = match self.voxel_m {
            _ if !config.window => 0.0,
            voxel_m if voxel_m < 0.015 => FRINGE,
            _ => LARGE_FRINGE,
        };
        let least = fringe * sum / count.max(1) as f32;
        kept().filter(|v| v.weight >= least).map(|v| (v.point(), v.mass)).unzip()
    }

    /// Counts the evidence of a view into all voxels (`sign` 1) or out of them (-1).
    fn testify(&mut self, view: &View, sign: i16) {
        let (origin, voxel_m) = (self.origin, self.voxel_m);
        self.voxels.iter_mut().for_each(|voxel| count(voxel, view, (&origin, voxel_m), sign));
    }

    /// Adds points with their weights; new voxels are marked fresh and take `remembered`.
    fn insert(&mut self, points: &[MapPoint], weight: impl Fn(usize) -> f32, remembered: u16) {
        let points = points.iter().enumerate();
        let mut keyed: Vec<([i32; 3], &MapPoint, f32)> =
            points.map(|(index, p)| (self.key(&p.position), p, weight(index))).collect();
        keyed.sort_by_key(|(key, _, _)| *key);
        let known = self.voxels.len();
        let mut cursor = 0;
        for (key, point, weight) in keyed {
            while cursor < known && self.voxels[cursor].key < key {
                cursor += 1;
            }
            if cursor < known && self.voxels[cursor].key == key {
                self.voxels[cursor].blend(point, weight);
            } else if let Some(last) = self.voxels[known..].last_mut().filter(|v| v.key == key) {
                last.blend(point, weight);
            } else {
                self.voxels.push(Voxel {
                    key,
                    position: point.position,
                    color: point.color.map(f32::from),
                    weight: weight.min(MEMORY),
                    mass: weight,
                    fresh: true,
                    hits: remembered,
                    chances: remembered,
                    remembered,
                });
            }
        }
        self.voxels.sort_by_key(|v| v.key);
    }

    fn key(&self, position: &Point3<f32>) -> [i32; 3] {
        ((position.coords - self.origin) / self.voxel_m).map(|c| c.floor() as i32).into()
    }

    /// Drops the oldest view of the sector that has the most, until the window fits: a robot that stands still must not
    /// push out what it saw from the other side.
    fn evict(&mut self, config: &BuildConfig, center: &Point3<f64>) {
        while self.views.len() > config.window_views {
            let sectors: Vec<_> = self.views.iter().map(|view| view.sector(center)).collect();
            let crowd = |i: usize| sectors.iter().filter(|s| **s == sectors[i]).count();
            let victim = (0..self.views.len()).fold(0, |best, i| if crowd(i) > crowd(best) { i } else { best });
            let view = self.views.remove(victim);
            self.testify(&view, -1);
            for voxel in &mut self.voxels {
                if voxel.hits == 0 && voxel.chances == 0 {
                    (voxel.hits, voxel.chances, voxel.remembered) = (1, 1, 1);
                }
            }
        }
        self.voxels.retain(|voxel| voxel.hits > 0);
    }

    fn coarsen(&mut self, voxel_m: f32) {
        let old = std::mem::take(&mut self.voxels);
        self.voxel_m = voxel_m;
        let points: Vec<MapPoint> = old.iter().map(Voxel::point).collect();
        self.insert(&points, |_| 0.0, 0);
        for voxel in &mut self.voxels {
            voxel.fresh = false;
        }
        for voxel in &old {
            let key = self.key(&voxel.position);
            if let Ok(i) = self.voxels.binary_search_by_key(&key, |v| v.key) {
                self.voxels[i].remembered = self.voxels[i].remembered.max(voxel.remembered);
                self.voxels[i].weight = (self.voxels[i].weight + voxel.weight).min(MEMORY);
                self.voxels[i].mass += voxel.mass;
            }
        }
        self.recount();
    }

    fn recount(&mut self) {
        let (origin, voxel_m, views) = (self.origin, self.voxel_m, &self.views);
        for voxel in &mut self.voxels {
            (voxel.hits, voxel.chances) = (voxel.remembered, voxel.remembered);
            views.iter().for_each(|view| count(voxel, view, (&origin, voxel_m), 1));
        }
        self.voxels.retain(|voxel| voxel.hits > 0);
    }
}

impl Voxel {
    fn point(&self) -> MapPoint {
        MapPoint { position: self.position, color: self.color.map(|c| c.round() as u8) }
    }

    fn blend(&mut self, point: &MapPoint, weight: f32) {
        self.weight = (self.weight + weight).min(MEMORY);
        self.mass += weight;
        let part = (weight / self.weight.max(1e-6)).min(1.0);
        self.position += (point.position - self.position) * part;
        self.color.iter_mut().zip(point.color).for_each(|(c, new)| *c += (f32::from(new) - *c) * part);
    }
}

fn count(voxel: &mut Voxel, view: &View, (origin, voxel_m): (&Vector3<f32>, f32), sign: i16) {
    // The voxel's centre, not its moving mean: taking a view back must find what adding it found.
    let center = Point3::from(voxel.key.map(|k| (k as f32 + 0.5) * voxel_m)) + origin;
    match view.testify(&center, POSE_TOLERANCE_M + voxel_m) {
        Evidence::Agrees => {
            voxel.hits = voxel.hits.saturating_add_signed(sign);
            voxel.chances = voxel.chances.saturating_add_signed(sign);
        }
        Evidence::Denies => voxel.chances = voxel.chances.saturating_add_signed(sign),
        Evidence::Silent => {}
    }
}

fn is_kept(voxel: &Voxel, config: &BuildConfig) -> bool {
    f64::from(voxel.hits) >= config.vote_share * f64::from(voxel.chances)
}

/// 1 cm for what fits in a hand, 2 cm for boxes and chairs, 4 cm for furniture.
fn voxel_size_m(extent: &Aabb) -> f32 {
    match extent.size().max() {
        size if size < 0.35 => 0.01,
        size if size < 1.2 => 0.02,
        _ => 0.04,
    }
}

/// Heights where the points of a thin slice cover a share of the footprint: boards, seats, the top.
fn find_surfaces((points, masses): (&[MapPoint], &[f32]), bounds: &OrientedBox, voxel_m: f64) -> Vec<f64> {
    const SLICE_M: f64 = 0.02;
    const SHARE: f64 = 0.15;
    let (bottom, top) = (bounds.bottom_m(), bounds.top_m());
    // Voxels, their mass, and its moment.
    let mut slices = vec![(0usize, 0.0f64, 0.0f64); ((top - bottom) / SLICE_M) as usize + 2];
    for (point, mass) in points.iter().zip(masses) {
        let z = f64::from(point.position.z);
        let slice = (((z - bottom) / SLICE_M).max(0.0) as usize).min(slices.len() - 1);
        slices[slice].0 += 1;
        slices[slice].1 += f64::from(*mass);
        slices[slice].2 += f64::from(*mass) * z;
    }
    let footprint_m2 = (bounds.size.x * bounds.size.y).max(1e-4);
    let mut counts: Vec<usize> = slices.iter().map(|s| s.0).collect();
    counts.sort_unstable();
    let median = counts[counts.len() / 2] as f64;
    let mut surfaces: Vec<f64> = Vec::new();
    for i in 0..slices.len() {
        let next = slices.get(i + 1).copied().unwrap_or_default();
        let pair = (slices[i].0 + next.0, slices[i].1 + next.1, slices[i].2 + next.2);
        let covered = pair.0 as f64 * voxel_m * voxel_m / footprint_m2;
        if covered >= SHARE && pair.0 as f64 > 3.0 * median {
            let height = pair.2 / pair.1.max(1e-9);
            if surfaces.last().is_none_or(|last| height - last > 0.06) && top - height > 0.06 {
                surfaces.push(height);
            }
        }
    }
    surfaces.push(top);
    surfaces
}
