//! Visual prompting: numbered marks on the things that a question speaks of.

use crate::picture::Canvas;
use dsm::perceive::Mask;

/// Digits, 3 by 5 pixels, one bit per pixel, rows from the top.
const DIGITS: [[u8; 5]; 10] = [
    [0b111, 0b101, 0b101, 0b101, 0b111],
    [0b010, 0b110, 0b010, 0b010, 0b111],
    [0b111, 0b001, 0b111, 0b100, 0b111],
    [0b111, 0b001, 0b111, 0b001, 0b111],
    [0b101, 0b101, 0b111, 0b001, 0b001],
    [0b111, 0b100, 0b111, 0b001, 0b111],
    [0b111, 0b100, 0b111, 0b101, 0b111],
    [0b111, 0b001, 0b010, 0b010, 0b010],
    [0b111, 0b101, 0b111, 0b101, 0b111],
    [0b111, 0b101, 0b111, 0b001, 0b111],
];
/// Size of a digit's pixel.
const SCALE: i64 = 2;
/// Colours of outlines, one after the other.
const COLORS: [[u8; 3]; 6] = [[255, 0, 0], [0, 200, 0], [0, 90, 255], [255, 160, 0], [200, 0, 200], [0, 190, 190]];

/// Draws the outline of a mask and its number in a black field in the thing's middle.
pub fn draw_mark(canvas: &mut Canvas, mask: &Mask, number: u32) {
    if mask.image_width == 0 {
        return;
    }
    let color = COLORS[number as usize % COLORS.len()];
    let (step, width) = (canvas.step.max(1), mask.image_width);
    let place = |pixel: u32| (i64::from(pixel % width / step), i64::from(pixel / width / step));
    for run in &mask.runs {
        for end in [run.start, run.start + run.length.saturating_sub(1)] {
            let (column, row) = place(end);
            canvas.set(column, row, color);
        }
    }
    if let Some(middle) = find_middle(mask) {
        draw_number(canvas, place(middle), number);
    }
}

/// The pixel of the mask that is closest to the middle of all its pixels, along whole runs.
fn find_middle(mask: &Mask) -> Option<u32> {
    let width = i64::from(mask.image_width);
    let center = |start: u32, length: u32| {
        let start = i64::from(start);
        (start % width + i64::from(length) / 2, start / width)
    };
    let area: i64 = mask.runs.iter().map(|run| i64::from(run.length)).sum();
    let sum = mask.runs.iter().fold((0, 0), |sum: (i64, i64), run| {
        let (column, row) = center(run.start, run.length);
        (sum.0 + column * i64::from(run.length), sum.1 + row * i64::from(run.length))
    });
    let middle = (sum.0.checked_div(area)?, sum.1.checked_div(area)?);
    let runs = mask.runs.iter().map(|run| {
        let row = i64::from(run.start) / width;
        let first = i64::from(run.start) % width;
        let column = middle.0.clamp(first, first + i64::from(run.length.max(1)) - 1);
        let apart = (column - middle.0).pow(2) + (row - middle.1).pow(2);
        (apart, row * width + column)
    });
    runs.min().map(|(_, pixel)| pixel as u32)
}

/// White digits on black, centred.
fn draw_number(canvas: &mut Canvas, (column, row): (i64, i64), number: u32) {
    let digits: Vec<usize> = number.to_string().bytes().map(|byte| usize::from(byte - b'0')).collect();
    let advance = 4 * SCALE;
    let (width, height) = (advance * digits.len() as i64 + SCALE, 7 * SCALE);
    // The field stays inside of the picture.
    let left = (column - width / 2).clamp(0, (i64::from(canvas.width) - width).max(0));
    let top = (row - height / 2).clamp(0, (i64::from(canvas.height) - height).max(0));
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        canvas.set(left + x, top + y, [0; 3]);
    }
    for (place, digit) in digits.iter().enumerate() {
        let left = left + SCALE + advance * place as i64;
        for (y, x) in (0..5 * SCALE).flat_map(|y| (0..3 * SCALE).map(move |x| (y, x))) {
            if DIGITS[*digit][(y / SCALE) as usize] >> (2 - x / SCALE) & 1 == 1 {
                canvas.set(left + x, top + SCALE + y, [255; 3]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a mark lies on its thing, also on a ring and at the picture's border, and never outside of the picture.
    use super::*;

    fn canvas() -> Canvas {
        Canvas { width: 40, height: 30, color: vec![[9; 3]; 1200], step: 1 }
    }

    fn mask(pixels: impl Iterator<Item = (u32, u32)>) -> Mask {
        let mut all: Vec<u32> = pixels.map(|(column, row)| row * 40 + column).collect();
        all.sort_unstable();
        Mask::from_sorted_pixels(40, all)
    }

    #[test]
    fn a_mark_lies_on_its_thing() {
        let square = mask((5..35).flat_map(|x| (3..28).map(move |y| (x, y))));
        assert_eq!(find_middle(&square), Some(15 * 40 + 20));
        let ring = mask((0..40).map(|x| (x, 0)).chain((0..40).map(|x| (x, 29))));
        let middle = find_middle(&ring).unwrap();
        assert!(ring.pixels().any(|pixel| pixel == middle as usize));
        let mut drawn = canvas();
        draw_mark(&mut drawn, &square, 7);
        assert_eq!(drawn.color[3 * 40 + 5], COLORS[1], "outline");
        assert!(drawn.color.iter().filter(|color| **color == [255; 3]).count() > 10, "digit");
    }

    #[test]
    fn any_mask_is_drawn_without_harm() {
        let corner = mask([(39, 29)].into_iter());
        let wide = Mask { image_width: 4000, runs: vec![dsm::perceive::Run { start: 3_999_999, length: 1 }] };
        for (mask, number) in
            [(&corner, 4_294_967_295), (&wide, 3), (&Mask::default(), 1), (&Mask { image_width: 5, runs: vec![] }, 2)]
        {
            draw_mark(&mut canvas(), mask, number);
        }
        draw_mark(&mut Canvas { width: 0, height: 0, color: vec![], step: 1 }, &corner, 1);
    }
}
