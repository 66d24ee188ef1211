//! Pictures for people: frames and the map as PNG, the map as SVG.

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::RgbdFrame;
use dsm::map::{CellState, Map, MapObject, ObjectId};
use dsm::raster::{Image, RenderOptions, Scene, Splats, render};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fmt::Write;

/// Colours of the map, sRGB: unknown, free and occupied ground, the driven path, the target.
const UNKNOWN: [u8; 3] = [214, 217, 222];
const FREE: [u8; 3] = [252, 252, 250];
const OCCUPIED: [u8; 3] = [120, 124, 132];
const PATH: [u8; 3] = [30, 110, 210];
const TARGET: [u8; 3] = [215, 40, 40];
/// Depth pictures run from violet (near) to yellow (here and beyond), metres.
const FARTHEST_M: f32 = 6.0;
/// Ground shown around what is known, metres.
const MARGIN_M: f64 = 0.3;
/// Where the camera of the map picture stands above the floor, metres: so high that tall things hardly lean outwards.
const EYE_HEIGHT_M: f64 = 120.0;
/// Units of the SVG in a metre.
const UNITS_PER_M: f64 = 100.0;
/// A page shows a unit of a drawing at least so large, or scrolls it: names stay above 12 pixels.
const LEAST_PIXELS_PER_UNIT: f64 = 0.88;

/// The colour image as PNG.
pub fn color_png(frame: &RgbdFrame) -> Vec<u8> {
    encode_png(frame.model.width, frame.model.height, &frame.color)
}

/// The colours of a rendered image as PNG.
pub fn image_png(image: &Image) -> Vec<u8> {
    encode_png(image.width, image.height, &image.color)
}

/// The depth image as PNG: violet is near, yellow 6 m and beyond, black no return.
pub fn depth_png(frame: &RgbdFrame) -> Vec<u8> {
    let pixels: Vec<[u8; 3]> = frame.depth_m.iter().map(|&depth| color_of_depth(depth)).collect();
    encode_png(frame.model.width, frame.model.height, &pixels)
}

/// The depth image in whole millimetres as 16-bit grey PNG; 0 where there is no return or it is beyond 65.5 m.
pub fn depth_mm_png(frame: &RgbdFrame) -> Vec<u8> {
    let mm = |depth: &f32| Some((f64::from(*depth) * 1e3).round()).filter(|mm| *mm <= 65_535.0).unwrap_or(0.0) as u16;
    let big_endian: Vec<u8> = frame.depth_m.iter().flat_map(|depth| mm(depth).to_be_bytes()).collect();
    let size = (frame.model.width, frame.model.height);
    encode(size, png::ColorType::Grayscale, png::BitDepth::Sixteen, &big_endian)
}

/// The frame at half its size, for pages with many pictures: colours are averaged, depths picked.
pub fn halved(frame: &RgbdFrame) -> RgbdFrame {
    let (width, height) = (frame.model.width / 2, frame.model.height / 2);
    let at = |column: u32, row: u32| row as usize * frame.model.width as usize + column as usize;
    let mut small = frame.clone();
    (small.model.width, small.model.height) = (width, height);
    for value in [&mut small.model.fx, &mut small.model.fy, &mut small.model.cx, &mut small.model.cy] {
        *value *= 0.5;
    }
    (small.color, small.depth_m) = (0..width * height)
        .map(|i| {
            let (column, row) = (2 * (i % width), 2 * (i / width));
            let four = [at(column, row), at(column + 1, row), at(column, row + 1), at(column + 1, row + 1)];
            let mean = std::array::from_fn(|k| {
                (four.iter().map(|&pixel| u32::from(frame.color[pixel][k])).sum::<u32>() / 4) as u8
            });
            (mean, frame.depth_m[four[0]])
        })
        .unzip();
    small
}

/// The map from above as SVG: ground, rooms, objects in the mean colour of their points, the driven path, and the target
/// in red. World x runs right, y up. Every name is escaped. `None` while nothing is known.
pub fn map_svg(map: &Map, path: &[Point2<f64>], target: Option<ObjectId>) -> Option<String> {
    let view = View::around(map, path)?;
    let size = view.size_m() * UNITS_PER_M;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" style=\"min-width:{:.0}px\" \
         role=\"img\" aria-label=\"The map from above\">\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        size.x,
        size.y,
        size.x * LEAST_PIXELS_PER_UNIT,
        hex(UNKNOWN)
    );
    // Writing to a String cannot fail, here and below.
    for (state, color) in [(CellState::Free, FREE), (CellState::Occupied, OCCUPIED)] {
        let _ = writeln!(svg, "<path fill=\"{}\" d=\"{}\"/>", hex(color), view.cells(map, state));
    }
    for room in &map.rooms {
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"none\" stroke=\"#7a8\" stroke-width=\"3\" stroke-dasharray=\"12 8\"/>",
            view.points(&room.polygon)
        );
    }
    let mut objects: Vec<&MapObject> = map.stable_objects().collect();
    // Low things first, so that what stands on them stays visible.
    objects.sort_by(|a, b| a.bounds.top_m().total_cmp(&b.bounds.top_m()).then(a.id.cmp(&b.id)));
    for object in &objects {
        let (stroke, width) = if Some(object.id) == target { (TARGET, 5.0) } else { ([40, 44, 52], 1.0) };
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"{}\" fill-opacity=\".85\" stroke=\"{}\" stroke-width=\"{width}\"><title>{} {}</title></polygon>",
            view.points(&object.bounds.footprint()),
            hex(mean_color(object)),
            hex(stroke),
            object.id.0,
            escape(object.name())
        );
    }
    if !path.is_empty() {
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"4\" stroke-linejoin=\"round\"/>",
            view.points(path),
            hex(PATH)
        );
    }
    if let (Some(first), Some(last)) = (path.first(), path.last()) {
        for (point, what, fill) in [(first, "start", FREE), (last, "end", PATH)] {
            let p = view.place(point);
            let _ = writeln!(
                svg,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"11\" fill=\"{}\" stroke=\"{}\" stroke-width=\"4\"><title>{what}</title></circle>",
                p.x,
                p.y,
                hex(fill),
                hex(PATH)
            );
        }
    }
    view.write_names(&mut svg, map, &objects, target);
    svg.push_str("</svg>\n");
    Some(svg)
}

/// The map from above as PNG with `pixels_per_m` pixels to a metre: the points that were measured, the objects' boxes, the
/// driven path, and the target's box in red. `None` while nothing is known.
pub fn map_png(map: &Map, path: &[Point2<f64>], target: Option<ObjectId>, pixels_per_m: f64) -> Option<Vec<u8>> {
    let view = View::around(map, path)?;
    let size = view.size_m() * pixels_per_m;
    let (width, height) = (size.x.ceil() as u32, size.y.ceil() as u32);
    let focal = pixels_per_m * EYE_HEIGHT_M;
    let model =
        CameraModel { width, height, fx: focal, fy: focal, cx: 0.5 * f64::from(width), cy: 0.5 * f64::from(height) };
    let middle = nalgebra::center(&view.low, &view.high);
    let eye = Point3::new(middle.x, middle.y, EYE_HEIGHT_M);
    // Half a turn about x: the camera looks along -z with world x to the right and world y up in the image.
    let downwards = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let world_from_camera = Pose::from_parts(eye.into(), downwards);
    let options = RenderOptions { background: UNKNOWN, far_m: 2.0 * EYE_HEIGHT_M as f32, ..Default::default() };
    let mut image = render(&points_of(map), &model, &world_from_camera, &options);
    let camera_from_world = world_from_camera.inverse();
    let mut canvas = Canvas { width: width as i64, height: height as i64, pixels: &mut image.color };
    let place = |p: &Point3<f64>| model.project(&(camera_from_world * p));
    let plan = |p: &Point2<f64>| place(&Point3::new(p.x, p.y, 0.0));
    for object in map.stable_objects() {
        let is_target = Some(object.id) == target;
        let corners = object.bounds.footprint().map(|p| place(&Point3::new(p.x, p.y, object.bounds.top_m())));
        for i in 0..4 {
            canvas.line(
                corners[i],
                corners[(i + 1) % 4],
                if is_target { TARGET } else { [60, 64, 72] },
                i64::from(is_target),
            );
        }
    }
    for pair in path.windows(2) {
        canvas.line(plan(&pair[0]), plan(&pair[1]), PATH, 1);
    }
    Some(encode_png(width, height, &image.color))
}

/// Text as it may stand in HTML and SVG, also within quotes.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Control characters are not allowed in XML at all.
            c if c.is_control() && c != '\n' && c != '\t' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// The mean colour of an object's points, sRGB.
pub fn mean_color(object: &MapObject) -> [u8; 3] {
    let count = object.points.len().max(1) as u64;
    std::array::from_fn(|k| (object.points.iter().map(|p| u64::from(p.color[k])).sum::<u64>() / count) as u8)
}

/// A colour as `#rrggbb`.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The part of the floor that is shown, world frame, metres.
struct View {
    low: Point2<f64>,
    high: Point2<f64>,
}

impl View {
    fn around(map: &Map, path: &[Point2<f64>]) -> Option<Self> {
        let half = Vector2::repeat(0.5 * map.free_space.resolution_m);
        let centers = map.free_space.known_cells().map(|(cell, _)| map.free_space.center_of(cell));
        let cells = centers.flat_map(|center| [center - half, center + half]);
        let footprints = map.stable_objects().flat_map(|o| o.bounds.footprint());
        let mut all =
            cells.chain(footprints).chain(path.iter().copied()).filter(|p| p.x.is_finite() && p.y.is_finite());
        let first = all.next()?;
        let (low, high) = all.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
        let margin = Vector2::repeat(MARGIN_M);
        Some(Self { low: low - margin, high: high + margin })
    }

    fn size_m(&self) -> Vector2<f64> {
        self.high - self.low
    }

    /// A point in units of the SVG; y runs down there.
    fn place(&self, point: &Point2<f64>) -> Point2<f64> {
        Point2::new((point.x - self.low.x) * UNITS_PER_M, (self.high.y - point.y) * UNITS_PER_M)
    }

    fn points(&self, points: &[Point2<f64>]) -> String {
        let mut text = String::new();
        for point in points {
            let p = self.place(point);
            let _ = write!(text, "{:.1},{:.1} ", p.x, p.y);
        }
        text.truncate(text.trim_end().len());
        text
    }

    /// All cells of a state as one path; neighbours in a row are joined.
    fn cells(&self, map: &Map, state: CellState) -> String {
        let known: BTreeSet<[i32; 2]> =
            map.free_space.known_cells().filter(|(_, s)| *s == state).map(|([x, y], _)| [y, x]).collect();
        let side = map.free_space.resolution_m;
        let mut text = String::new();
        let mut cells = known.into_iter().peekable();
        while let Some([row, first]) = cells.next() {
            let mut end = first + 1;
            while cells.next_if_eq(&[row, end]).is_some() {
                end += 1;
            }
            let p = self.place(&Point2::new(f64::from(first) * side, f64::from(row + 1) * side));
            let (width, height) = (f64::from(end - first) * side * UNITS_PER_M, side * UNITS_PER_M);
            let _ = write!(text, "M{:.1} {:.1}h{width:.1}v{height:.1}h-{width:.1}z", p.x, p.y);
        }
        text
    }

    /// Names of rooms and objects where there is room for them; the target's and large things' names come first.
    fn write_names(&self, svg: &mut String, map: &Map, objects: &[&MapObject], target: Option<ObjectId>) {
        let mut names: Vec<(Point2<f64>, String, f64, [u8; 3])> = Vec::new();
        for room in &map.rooms {
            names.push((self.place(&room.center), room.name.clone(), 22.0, [70, 120, 95]));
        }
        let mut by_size = objects.to_vec();
        let area = |o: &MapObject| o.bounds.size.x * o.bounds.size.y;
        by_size.sort_by(|a, b| {
            let first = |o: &MapObject| Some(o.id) != target;
            first(a).cmp(&first(b)).then(area(b).total_cmp(&area(a))).then(a.id.cmp(&b.id))
        });
        for object in by_size {
            let color = if Some(object.id) == target { TARGET } else { [30, 34, 42] };
            names.push((self.place(&object.bounds.center.xy()), object.name().to_owned(), 14.0, color));
        }
        let mut taken: Vec<[f64; 4]> = Vec::new();
        for (at, name, height, color) in names {
            let half = 0.3 * height * name.chars().count() as f64;
            let spot = [at.x - half, at.y - 0.5 * height, at.x + half, at.y + 0.5 * height];
            if taken.iter().any(|t| spot[0] < t[2] && t[0] < spot[2] && spot[1] < t[3] && t[1] < spot[3]) {
                continue;
            }
            taken.push(spot);
            // The halo is an element of its own: not every viewer paints an outline below its letters.
            let _ = writeln!(
                svg,
                "<g font-size=\"{height}\" text-anchor=\"middle\" fill=\"{0}\"><text x=\"{1:.1}\" y=\"{2:.1}\" stroke=\"#fff\" \
                 stroke-width=\"3\" aria-hidden=\"true\">{3}</text><text x=\"{1:.1}\" y=\"{2:.1}\">{3}</text></g>",
                hex(color),
                at.x,
                at.y + 0.35 * height,
                escape(&name)
            );
        }
    }
}

/// What was measured, as points: ground a little below the floor, then the objects.
fn points_of(map: &Map) -> Scene {
    let mut scene = Scene::default();
    let side = map.free_space.resolution_m;
    for (state, color) in [(CellState::Free, FREE), (CellState::Occupied, OCCUPIED)] {
        let cells = map.free_space.known_cells().filter(|(_, s)| *s == state);
        let points: Vec<Point3<f32>> = cells
            .map(|(cell, _)| map.free_space.center_of(cell))
            .map(|p| Point3::new(p.x as f32, p.y as f32, -0.1))
            .collect();
        let colors = vec![color; points.len()];
        // A disc that reaches the corners of its cell leaves no gap.
        scene.splats.push(Splats { points_in_world: points, colors, radius_m: (0.71 * side) as f32, label: 1 });
    }
    for object in map.stable_objects() {
        let (points_in_world, colors) = object.points.iter().map(|p| (p.position, p.color)).unzip();
        scene.splats.push(Splats { points_in_world, colors, radius_m: disc_radius_m(object), label: 2 });
    }
    scene
}

/// Half the spacing of an object's points, had they been spread over the upper faces of its box: their number is bounded,
/// so large things have sparse points.
fn disc_radius_m(object: &MapObject) -> f32 {
    let size = object.bounds.size;
    let area_m2 = size.x * size.y + (size.x + size.y) * size.z;
    let spacing_m = (area_m2 / object.points.len().max(1) as f64).sqrt();
    (0.6 * spacing_m).clamp(0.005, 0.05) as f32
}

struct Canvas<'a> {
    width: i64,
    height: i64,
    pixels: &'a mut [[u8; 3]],
}

impl Canvas<'_> {
    /// A line; `thick` pixels are added on each side.
    fn line(&mut self, from: Option<Point2<f64>>, to: Option<Point2<f64>>, color: [u8; 3], thick: i64) {
        let (Some(from), Some(to)) = (from, to) else { return };
        let steps = (to - from).amax().ceil().clamp(1.0, 1e5);
        for i in 0..=steps as i64 {
            let p = from + (to - from) * (i as f64 / steps);
            let (column, row) = (p.x.floor() as i64, p.y.floor() as i64);
            for y in row - thick..=row + thick {
                for x in column - thick..=column + thick {
                    if (0..self.width).contains(&x) && (0..self.height).contains(&y) {
                        self.pixels[(y * self.width + x) as usize] = color;
                    }
                }
            }
        }
    }
}

/// Colours of rising brightness, so that the picture also reads in grey.
fn color_of_depth(depth_m: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] =
        [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];
    if depth_m <= 0.0 {
        return [0; 3];
    }
    let at = (depth_m / FARTHEST_M).clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let low = (at as usize).min(STOPS.len() - 2);
    let share = at - low as f32;
    std::array::from_fn(|k| (STOPS[low][k] * (1.0 - share) + STOPS[low + 1][k] * share).round() as u8)
}

pub(crate) fn encode_png(width: u32, height: u32, pixels: &[[u8; 3]]) -> Vec<u8> {
    encode((width, height), png::ColorType::Rgb, png::BitDepth::Eight, pixels.as_flattened())
}

fn encode((width, height): (u32, u32), color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    // Noise does not get smaller by trying harder.
    encoder.set_compression(png::Compression::Fast);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(data));
    // Only an image without pixels, or one whose sides do not fit its pixels, is refused; there is nothing to show then.
    if written.is_err() {
        bytes.clear();
    }
    bytes
}

#[cfg(test)]
#[path = "picture_tests.rs"]
pub(crate) mod tests;
