//! Third stage: colour, depth and label of what is seen, in short pieces of rows.

use super::image::{SrgbTable, linear_from_srgb};
use super::lighting::{CameraLight, Lane, Lighting, PIECE, Surfaces};
use super::scene::{Material, Scene};
use super::setup::{Prepared, Seen, Surface, Thing};
use super::texture::{Level, Texture, WHITE, find_block, light_of};
use super::triangle::Triangle;
use super::visibility::Band;
use crate::Pose;
use crate::camera::CameraModel;
use nalgebra::Vector3;
use std::ops::Range;

/// 0, 1, 2, ... as numbers: a count kept as a float would tie each pixel to the one before.
const STEPS: Lane = {
    let mut steps = [0.0; PIECE];
    let mut i = 0;
    while i < PIECE {
        steps[i] = i as f32;
        i += 1;
    }
    steps
};

/// A material ready for shading.
struct Look<'a> {
    color: [f32; 3],
    texture: Option<&'a Texture>,
    repeat: [f32; 2],
    /// Texels squared per unit of texture coordinates squared.
    texels: f32,
    specular: f32,
    shininess: f32,
    metallic: f32,
    emission: f32,
}

/// What is gathered about one piece of a row.
struct Piece<'a> {
    surfaces: Surfaces,
    /// Barycentric coordinates of the second and third vertex.
    second: Lane,
    third: Lane,
    textured: Textured<'a>,
}

/// The textures of a piece: gathered run by run, filtered together.
struct Textured<'a> {
    u: Lane,
    v: Lane,
    width: Lane,
    height: Lane,
    /// Neighbouring pixels of one picture: where they begin and end.
    runs: [(Range<usize>, Option<&'a Level>); PIECE],
    count: usize,
}

/// All that shading needs to know about one view.
pub(super) struct Shader<'a> {
    prepared: &'a Prepared,
    srgb: &'a SrgbTable,
    background: [u8; 3],
    labels: Vec<u32>,
    looks: Vec<Look<'a>>,
    look_of_instance: Vec<u32>,
    lighting: Lighting<'a>,
    /// Direction of each column and row of pixels at z = 1.
    columns: Vec<f32>,
    rows: Vec<f32>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        model: &CameraModel,
        world_from_camera: &Pose,
        prepared: &'a Prepared,
        background: [u8; 3],
        srgb: &'a SrgbTable,
    ) -> Self {
        let camera_from_world = world_from_camera.inverse();
        let up: Vector3<f32> = (camera_from_world.rotation * Vector3::z()).cast();
        let east: Vector3<f32> = (camera_from_world.rotation * Vector3::x()).cast();
        let ray = |i: u32, center: f64, focal: f64| ((f64::from(i) + 0.5 - center) / focal) as f32;
        // A whole number of pieces, so that the last one needs no care.
        let padded = model.width.next_multiple_of(PIECE as u32);
        Self {
            prepared,
            srgb,
            background,
            labels: scene.instances.iter().map(|instance| instance.label).collect(),
            looks: scene.materials().iter().map(|material| look(scene, material)).collect(),
            look_of_instance: scene.instances.iter().map(|instance| instance.material.0).collect(),
            lighting: Lighting {
                lights: scene.lights.iter().map(|light| CameraLight::new(light, &camera_from_world)).collect(),
                ambient: scene.ambient,
                up: up.into(),
                east: east.into(),
                shadow: scene.shadow().map(|shadow| shadow.view(world_from_camera)),
            },
            columns: (0..padded).map(|column| ray(column, model.cx, model.fx)).collect(),
            rows: (0..model.height).map(|row| ray(row, model.cy, model.fy)).collect(),
        }
    }

    /// Shades a band; the slices hold its pixels. Everything below is compiled into each set of instructions that
    /// the caller picks from, which is why it is always inlined; the arithmetic is the same in all of them.
    #[inline(always)]
    pub(super) fn shade(&self, band: &Band, color: &mut [[u8; 3]], depth_m: &mut [f32], labels: &mut [u32]) {
        let width = band.width as usize;
        let mut piece =
            Piece { surfaces: Surfaces::new(), second: [0.0; PIECE], third: [0.0; PIECE], textured: Textured::new() };
        for row in band.first_row..band.end_row {
            let line = (row - band.first_row) as usize * width;
            for first in (0..width).step_by(PIECE) {
                let pixels = line + first..line + (first + PIECE).min(width);
                let seen = &band.seen[pixels.clone()];
                let inverse_z = &band.inverse_z[pixels.clone()];
                let columns: &Lane = match self.columns[first..].first_chunk() {
                    Some(columns) => columns,
                    None => continue,
                };
                let lit = self.gather(&mut piece, seen, inverse_z, first, row, &mut labels[pixels.clone()]);
                for ((depth, z), seen) in depth_m[pixels.clone()].iter_mut().zip(&piece.surfaces.z).zip(seen) {
                    *depth = if *seen == Seen::NOTHING { 0.0 } else { *z };
                }
                let color = &mut color[pixels];
                if lit {
                    piece.textured.apply(&mut piece.surfaces.albedo);
                    let light = self.lighting.shine(&mut piece.surfaces, columns, self.rows[row as usize]);
                    self.encode(&light, color);
                }
                self.color_unlit(seen, color);
            }
        }
    }

    /// Light as sRGB.
    #[inline(always)]
    fn encode(&self, light: &[Lane; 3], color: &mut [[u8; 3]]) {
        let mut steps = [[0_u32; PIECE]; 3];
        for (steps, light) in steps.iter_mut().zip(light) {
            for i in 0..PIECE {
                steps[i] = SrgbTable::step(light[i]);
            }
        }
        let [red, green, blue] = &steps;
        for (((pixel, r), g), b) in color.iter_mut().zip(red).zip(green).zip(blue) {
            *pixel = [self.srgb.encode(*r), self.srgb.encode(*g), self.srgb.encode(*b)];
        }
    }

    /// Fetches the surfaces of a piece and writes its labels; returns whether any of them needs light.
    #[inline(always)]
    fn gather(
        &self,
        piece: &mut Piece<'a>,
        seen: &[Seen],
        inverse_z: &[f32],
        first_column: usize,
        row: u32,
        labels: &mut [u32],
    ) -> bool {
        for (z, inverse) in piece.surfaces.z.iter_mut().zip(inverse_z) {
            *z = 1.0 / inverse;
        }
        piece.surfaces.glossy = false;
        piece.surfaces.metals = false;
        piece.textured.count = 0;
        let mut lit = false;
        let mut start = 0;
        while start < seen.len() {
            let here = seen[start];
            let length = seen[start..].iter().take_while(|&&other| other == here).count();
            let run = start..start + length;
            start += length;
            labels[run.clone()].fill(match here.thing() {
                Thing::Triangle { part, index } => {
                    lit = true;
                    let part = &self.prepared.parts[part];
                    let (triangle, surface) = (&part.triangles[index], &part.surfaces[index]);
                    let [a, b, c] = surface.vertices;
                    let vertex = |i: u32| &part.vertices[i as usize];
                    let look = &self.looks[self.look_of_instance[surface.instance as usize] as usize];
                    let pixel = [first_column as i32, row as i32];
                    gather_run(piece, triangle, surface, [vertex(a), vertex(b), vertex(c)], look, run, pixel);
                    self.labels[surface.instance as usize]
                }
                Thing::Nothing => 0,
                Thing::Disc { index } => self.prepared.discs[index].label,
            });
        }
        lit
    }

    /// Points keep the colour they were measured with; where nothing is seen there is the background.
    #[inline(always)]
    fn color_unlit(&self, seen: &[Seen], color: &mut [[u8; 3]]) {
        for (pixel, seen) in color.iter_mut().zip(seen) {
            if !seen.is_triangle() {
                *pixel = match seen.thing() {
                    Thing::Disc { index } => self.prepared.discs[index].color,
                    _ => self.background,
                };
            }
        }
    }
}

/// The surfaces of neighbouring pixels of one triangle, from a piece that begins at the given column and row.
#[inline(always)]
fn gather_run<'a>(
    piece: &mut Piece<'a>,
    triangle: &Triangle,
    surface: &Surface,
    [a, b, c]: [&super::setup::Vertex; 3],
    look: &Look<'a>,
    run: Range<usize>,
    [first_column, row]: [i32; 2],
) {
    let Piece { surfaces, second, third, textured } = piece;
    let side = if triangle.back { -1.0 } else { 1.0 };
    if !surface.flat || look.texture.is_some() {
        let (column, row) =
            ((first_column + run.start as i32 - triangle.origin[0]) as f32, (row - triangle.origin[1]) as f32);
        let shares = &surface.shares;
        let starts = [shares.second.at(column, row), shares.third.at(column, row)];
        let (s, t) = (&mut second[run.clone()], &mut third[run.clone()]);
        for (((s, t), z), step) in s.iter_mut().zip(t.iter_mut()).zip(&surfaces.z[run.clone()]).zip(&STEPS) {
            *s = ((starts[0] + step * shares.second.per_column) * z).clamp(0.0, 1.0);
            *t = ((starts[1] + step * shares.third.per_column) * z).clamp(0.0, 1.0);
        }
    }
    let (s, t) = (&second[run.clone()], &third[run.clone()]);
    if surface.flat {
        for (lane, value) in surfaces.normal.iter_mut().zip(a.normal.iter()) {
            lane[run.clone()].fill(value * side);
        }
    } else {
        let (start, edge_b, edge_c) = (a.normal * side, (b.normal - a.normal) * side, (c.normal - a.normal) * side);
        for (axis, lane) in surfaces.normal.iter_mut().enumerate() {
            for ((value, s), t) in lane[run.clone()].iter_mut().zip(s).zip(t) {
                *value = start[axis] + s * edge_b[axis] + t * edge_c[axis];
            }
        }
    }
    if let Some(texture) = look.texture {
        let z = surfaces.z[run.start + run.len() / 2];
        let level = texture.level(texture.level_for(surface.uv_density * z * z * z * look.texels));
        let (u, v) = (&mut textured.u[run.clone()], &mut textured.v[run.clone()]);
        let [along_u, along_v] = [0, 1].map(|i: usize| {
            let repeat = look.repeat[i];
            [a.uv[i] * repeat, (b.uv[i] - a.uv[i]) * repeat, (c.uv[i] - a.uv[i]) * repeat]
        });
        for (((u, v), s), t) in u.iter_mut().zip(v.iter_mut()).zip(s).zip(t) {
            *u = along_u[0] + s * along_u[1] + t * along_u[2];
            *v = along_v[0] + s * along_v[1] + t * along_v[2];
        }
        textured.add(run.clone(), level);
    }
    for (lane, value) in surfaces.albedo.iter_mut().zip(look.color) {
        lane[run.clone()].fill(value);
    }
    surfaces.specular[run.clone()].fill(look.specular);
    surfaces.shininess[run.clone()].fill(look.shininess);
    surfaces.metallic[run.clone()].fill(look.metallic);
    surfaces.emission[run].fill(look.emission);
    surfaces.metals |= look.metallic > 0.0;
    surfaces.glossy |= look.specular > 0.0 || look.metallic > 0.0;
}

impl<'a> Textured<'a> {
    fn new() -> Self {
        let lane = [0.0; PIECE];
        Self {
            u: lane,
            v: lane,
            width: [1.0; PIECE],
            height: [1.0; PIECE],
            runs: [const { (0..0, None) }; PIECE],
            count: 0,
        }
    }

    /// Notes a run whose texture coordinates are known.
    #[inline(always)]
    fn add(&mut self, run: Range<usize>, level: &'a Level) {
        let [width, height] = level.size();
        self.width[run.clone()].fill(width);
        self.height[run.clone()].fill(height);
        self.runs[self.count] = (run, Some(level));
        self.count += 1;
    }

    /// Multiplies the light of the textures into the colours.
    #[inline(always)]
    fn apply(&self, albedo: &mut [Lane; 3]) {
        if self.count == 0 {
            return;
        }
        // 1. Where to look.
        let (mut columns, mut rows) = ([0_u32; PIECE], [0_u32; PIECE]);
        let (mut right, mut low) = ([0.0; PIECE], [0.0; PIECE]);
        for i in 0..PIECE {
            (columns[i], right[i]) = find_block(self.u[i], self.width[i]);
            (rows[i], low[i]) = find_block(self.v[i], self.height[i]);
        }
        // 2. Look. What has no texture is white.
        let mut texels = [[WHITE; PIECE]; 4];
        let [a, b, c, d] = &mut texels;
        for (run, level) in &self.runs[..self.count] {
            let Some(level) = level else { continue };
            for i in run.clone() {
                [a[i], b[i], c[i], d[i]] = level.block(columns[i], rows[i]);
            }
        }
        // 3. Blend.
        for (albedo, shift) in albedo.iter_mut().zip([0, 10, 20]) {
            for i in 0..PIECE {
                let [a, b, c, d] =
                    [light_of(a[i], shift), light_of(b[i], shift), light_of(c[i], shift), light_of(d[i], shift)];
                let upper = a + (b - a) * right[i];
                let lower = c + (d - c) * right[i];
                albedo[i] *= upper + (lower - upper) * low[i];
            }
        }
    }
}

fn look<'a>(scene: &'a Scene, material: &Material) -> Look<'a> {
    let texture = material.texture.map(|index| scene.texture(index));
    let [u, v] = material.texture_repeat;
    Look {
        color: material.color.map(linear_from_srgb),
        texture,
        repeat: material.texture_repeat,
        texels: texture.map_or(0.0, |texture| (u * v).abs() * (texture.width() * texture.height()) as f32),
        specular: material.specular,
        shininess: material.shininess,
        metallic: material.metallic,
        emission: material.emission,
    }
}
