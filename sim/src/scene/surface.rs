//! Materials, textures and lights of a scene.

use super::defaults::{Defaults, is_default};
use super::error::SceneError;
use super::model::{LightKind, SceneLight, SceneMaterial, SceneTexture, TextureSpan};
use super::source::Source;
use dsm::Pose;
use nalgebra::{Point3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::path::Path;

/// MuJoCo's colour of a geom without material and without `rgba`.
pub(super) const PLAIN_RGBA: [f64; 4] = [0.5, 0.5, 0.5, 1.0];
/// MuJoCo's default width and height of builtin textures are 0; this is used instead, pixels.
const BUILTIN_SIZE_PX: u32 = 64;
/// MuJoCo's default headlight: ambient and diffuse.
const HEADLIGHT: ([f32; 3], [f32; 3]) = ([0.1; 3], [0.4; 3]);

/// The first element with this tag and name.
pub(super) fn find_node<'a>(document: &'a Document<'a>, tag: &str, name: &str) -> Option<Node<'a, 'a>> {
    let named = |node: &Node<'_, '_>| {
        let stem = || Path::new(node.attribute("file")?).file_stem()?.to_str();
        node.has_tag_name(tag) && node.attribute("name").or_else(stem) == Some(name)
    };
    document.descendants().find(named)
}

/// Numbers of an attribute that passed the lint.
fn numbers<const N: usize>(node: Node<'_, '_>, attribute: &str) -> Option<[f32; N]> {
    parse(node.attribute(attribute)?)
}

fn parse<const N: usize>(text: &str) -> Option<[f32; N]> {
    let parsed: Vec<f32> = text.split_ascii_whitespace().flat_map(str::parse).collect();
    parsed.try_into().ok()
}

/// The texture that a material shows: its attribute, or its layer of colours.
fn texture_of<'a>(material: Node<'a, 'a>, defaults: &Defaults<'a>) -> Option<&'a str> {
    let layers = material.children().filter(|child| child.has_tag_name("layer"));
    let mut colors = layers.filter(|layer| matches!(layer.attribute("role"), Some("rgb" | "rgba")));
    colors.find_map(|layer| layer.attribute("texture")).or_else(|| defaults.find(material, "texture"))
}

/// Whether a texture is wrapped around things as a cube; MuJoCo's default.
fn is_cube(texture: &str, document: &Document<'_>) -> bool {
    find_node(document, "texture", texture).is_some_and(|node| matches!(node.attribute("type"), None | Some("cube")))
}

/// Textures by index and what they are called.
pub(super) fn load_textures(
    model: &mjcf_rs::Model,
    document: &Document<'_>,
    source: &Source,
    folder: &Path,
) -> Result<Vec<SceneTexture>, SceneError> {
    let mut textures = Vec::new();
    for texture in &model.assets.textures {
        let name = texture.name.clone().unwrap_or_default();
        let node = find_node(document, "texture", &name);
        let place = source.place(node.map_or(0, |n| n.range().start));
        if texture.type_.as_deref() == Some("skybox") {
            continue;
        }
        let pixels = match model.resolve_texture_file(texture, folder) {
            Some(path) if !path.exists() => return Err(SceneError::MissingFile { place, kind: "texture", path }),
            Some(path) => decode_png(&path).map_err(|reason| SceneError::BrokenFile {
                place,
                kind: "texture",
                path,
                reason,
                expected: "an 8-bit or 16-bit PNG",
            })?,
            None => {
                let size = |name| node.and_then(|n| n.attribute(name)?.parse().ok()).filter(|size| *size > 0);
                let rgb = |color: Option<[f64; 3]>, default: f64| {
                    color.unwrap_or([default; 3]).map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
                };
                let mut built = builtin(
                    texture.builtin.as_deref().unwrap_or("none"),
                    size("width").unwrap_or(BUILTIN_SIZE_PX),
                    size("height").unwrap_or(BUILTIN_SIZE_PX),
                    rgb(texture.rgb1, 0.8),
                    rgb(texture.rgb2, 0.5),
                );
                if node.and_then(|n| n.attribute("mark")).is_some_and(|mark| mark == "edge" || mark == "cross") {
                    let color = node.and_then(|n| numbers::<3>(n, "markrgb")).unwrap_or([0.0; 3]);
                    mark(&mut built, node.and_then(|n| n.attribute("mark")) == Some("cross"), color);
                }
                built
            }
        };
        textures.push(SceneTexture { name, width: pixels.0, height: pixels.1, rgb: pixels.2 });
    }
    Ok(textures)
}

type Pixels = (u32, u32, Vec<[u8; 3]>);

/// A PNG as sRGB; alpha is dropped, grey is spread.
fn decode_png(path: &Path) -> Result<Pixels, String> {
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let mut decoder = png::Decoder::new(std::io::BufReader::new(file));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let size = reader.output_buffer_size().ok_or("the image is too large")?;
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(|e| e.to_string())?;
    let channels = frame.color_type.samples();
    let rgb = bytes[..frame.buffer_size()]
        .chunks_exact(channels)
        .map(|pixel| if channels < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] })
        .collect();
    Ok((frame.width, frame.height, rgb))
}

/// MuJoCo's builtin patterns: flat, a 2x2 checker, a gradient from `rgb1` (middle) to `rgb2` (border).
fn builtin(kind: &str, width: u32, height: u32, rgb1: [u8; 3], rgb2: [u8; 3]) -> Pixels {
    let mix = |t: f32| std::array::from_fn(|i| (f32::from(rgb1[i]) * (1.0 - t) + f32::from(rgb2[i]) * t).round() as u8);
    let centred = |value: u32, size: u32| 2.0 * (value as f32 + 0.5) / size as f32 - 1.0;
    let color = |column: u32, row: u32| match kind {
        "checker" if (2 * column / width + 2 * row / height) % 2 == 1 => rgb2,
        "gradient" => mix(centred(column, width).hypot(centred(row, height)).min(1.0)),
        _ => rgb1,
    };
    let rgb =
        (0..height).flat_map(|row| (0..width).map(move |column| (column, row))).map(|(c, r)| color(c, r)).collect();
    (width, height, rgb)
}

/// Draws a one-pixel line around the border, or through the middle.
fn mark((width, height, rgb): &mut Pixels, cross: bool, color: [f32; 3]) {
    let color = color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
    for (index, pixel) in rgb.iter_mut().enumerate() {
        let (column, row) = (index as u32 % *width, index as u32 / *width);
        let on_edge = column == 0 || row == 0 || column + 1 == *width || row + 1 == *height;
        let on_cross = column == *width / 2 || row == *height / 2;
        if if cross { on_cross } else { on_edge } {
            *pixel = color;
        }
    }
}

/// The materials of a scene, grown by one for each colour that a geom sets by itself.
pub(super) struct Materials {
    /// All materials.
    pub list: Vec<SceneMaterial>,
    /// How many of them stem from the asset block itself.
    of_assets: usize,
}

impl Materials {
    /// Materials of the asset block, then a plain one.
    pub(super) fn new<'a>(
        model: &mjcf_rs::Model,
        document: &'a Document<'a>,
        defaults: &Defaults<'a>,
        textures: &[SceneTexture],
    ) -> Self {
        let list = model
            .assets
            .materials
            .iter()
            .map(|material| {
                let name = material.name.clone().unwrap_or_default();
                let node = find_node(document, "material", &name);
                let text = |attribute| node.and_then(|node| defaults.find(node, attribute));
                let texture = node.and_then(|node| texture_of(node, defaults)).or(material.texture.as_deref());
                let span = match text("texuniform") {
                    _ if texture.is_some_and(|texture| is_cube(texture, document)) => TextureSpan::Cube,
                    Some("true") => TextureSpan::Metre,
                    _ => TextureSpan::Face,
                };
                // As in MuJoCo, a cube is never repeated.
                let repeat = text("texrepeat").filter(|_| span != TextureSpan::Cube).and_then(parse);
                SceneMaterial {
                    rgba: material.rgba.unwrap_or([1.0; 4]).map(|c| c as f32),
                    texture: texture.and_then(|name| textures.iter().position(|t| t.name == name)),
                    texture_repeat: repeat.unwrap_or([1.0; 2]),
                    texture_span: span,
                    specular: material.specular as f32,
                    shininess: material.shininess as f32,
                    // MuJoCo's default, -1, means that nothing is said.
                    metallic: text("metallic").and_then(parse).map_or(0.0, |[m]: [f32; 1]| m.clamp(0.0, 1.0)),
                    emission: material.emission as f32,
                    name,
                }
            })
            .collect::<Vec<_>>();
        Self { of_assets: list.len(), list }
    }

    /// Whether it stems from no material of the asset block and has no colour of its own, or one to look through.
    pub(super) fn is_plain(&self, index: usize) -> bool {
        let rgba = self.list[index].rgba;
        let of_geom = index >= self.of_assets && self.list[index].name.starts_with('#');
        of_geom && (rgba[3] < 1.0 || rgba == PLAIN_RGBA.map(|value| value as f32))
    }

    /// The index of the material of a geom, made when it is new.
    pub(super) fn index_of(&mut self, material: Option<&str>, rgba: Option<[f64; 4]>) -> usize {
        let base = material.and_then(|name| self.list.iter().position(|m| m.name == name));
        // As in MuJoCo: a colour at the geom wins over its material's unless it is the default grey.
        let own = rgba.filter(|c| base.is_none() || *c != PLAIN_RGBA).map(|c| c.map(|v| v as f32));
        match (base, own) {
            (Some(index), None) => index,
            (base, own) => {
                let rgba = own.unwrap_or(PLAIN_RGBA.map(|v| v as f32));
                let mut wanted = base.map_or(
                    SceneMaterial {
                        name: String::new(),
                        rgba,
                        texture: None,
                        texture_repeat: [1.0; 2],
                        texture_span: TextureSpan::Face,
                        specular: 0.5,
                        shininess: 0.5,
                        metallic: 0.0,
                        emission: 0.0,
                    },
                    |index| self.list[index].clone(),
                );
                wanted.rgba = rgba;
                let [r, g, b, a] = rgba;
                wanted.name = format!("{}#{r} {g} {b} {a}", wanted.name);
                let known = self.list.iter().position(|m| *m == wanted);
                known.unwrap_or_else(|| {
                    self.list.push(wanted);
                    self.list.len() - 1
                })
            }
        }
    }
}

/// Lights of the world body, and the headlight as ambient light (it would move with the camera).
pub(super) fn load_lights<'a>(
    document: &'a Document<'a>,
    defaults: &Defaults<'a>,
    pose_of: impl Fn(Node<'_, '_>) -> Pose,
) -> Vec<SceneLight> {
    let mut lights = Vec::new();
    let root = document.root_element();
    for node in root.descendants().filter(|n| n.has_tag_name("light") && !is_default(n)) {
        let text = |name: &str| defaults.find(node, name);
        let triple = |name: &str, default: [f32; 3]| text(name).and_then(parse).unwrap_or(default);
        if text("active") == Some("false") {
            continue;
        }
        let world_from_parent = pose_of(node).cast::<f32>();
        let directional = text("directional") == Some("true") || text("type") == Some("directional");
        let kind = if directional {
            let direction = world_from_parent * Vector3::from(triple("dir", [0.0, 0.0, -1.0]));
            let down = -Vector3::z_axis();
            LightKind::Directional { direction: Unit::try_new(direction, 1e-6).unwrap_or(down).into_inner() }
        } else {
            LightKind::Point { position: world_from_parent * Point3::from(triple("pos", [0.0; 3])) }
        };
        let (diffuse, ambient) = (triple("diffuse", [0.7; 3]), triple("ambient", [0.0; 3]));
        lights.push(SceneLight { kind, diffuse, ambient, casts_shadow: text("castshadow") != Some("false") });
    }
    let headlight = document.descendants().find(|n| n.has_tag_name("headlight"));
    if headlight.and_then(|n| n.attribute("active")) != Some("0") {
        let color = |name, default| headlight.and_then(|n| numbers::<3>(n, name)).unwrap_or(default);
        let (ambient, diffuse) = (color("ambient", HEADLIGHT.0), color("diffuse", HEADLIGHT.1));
        // Seen along the viewing direction, a surface returns half of it on average.
        let ambient = std::array::from_fn(|i| ambient[i] + 0.5 * diffuse[i]);
        let kind = LightKind::Directional { direction: -Vector3::z() };
        lights.push(SceneLight { kind, diffuse: [0.0; 3], ambient, casts_shadow: false });
    }
    lights
}
