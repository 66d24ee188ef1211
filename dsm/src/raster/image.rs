//! The rendered image and the sRGB curve.

/// A rendered image, row-major, `width * height` pixels. Its buffers can be rendered into again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Colour, sRGB.
    pub color: Vec<[u8; 3]>,
    /// Depth along the camera's z in metres; 0 where there is nothing.
    pub depth_m: Vec<f32>,
    /// Label of the instance or points seen; 0 is the background.
    pub labels: Vec<u32>,
}

impl Image {
    /// Gives the buffers the size of a camera; what they hold is overwritten by the next rendering.
    pub(super) fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        let count = width as usize * height as usize;
        self.color.resize(count, [0; 3]);
        self.depth_m.resize(count, 0.0);
        self.labels.resize(count, 0);
    }
}

/// Linear light, 0 to 1, of an sRGB value, 0 to 1 (IEC 61966-2-1).
pub fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// sRGB value, 0 to 1, of linear light, 0 to 1 (IEC 61966-2-1).
pub fn srgb_from_linear(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// The sRGB curve as a table over linear light: 4096 steps are finer than one 8-bit step everywhere.
#[derive(Debug)]
pub(super) struct SrgbTable(Box<[u8; SrgbTable::SIZE]>);

impl SrgbTable {
    const SIZE: usize = 4096;

    pub(super) fn new() -> Self {
        let mut table = Box::new([0; Self::SIZE]);
        for (step, value) in table.iter_mut().enumerate() {
            *value = (255.0 * srgb_from_linear(step as f32 / (Self::SIZE - 1) as f32)).round() as u8;
        }
        Self(table)
    }

    /// The step of linear light; light above 1 is white, below 0 black.
    #[inline(always)]
    pub(super) fn step(light: f32) -> u32 {
        const LAST: f32 = (SrgbTable::SIZE - 1) as f32;
        let scaled = light * LAST;
        let scaled = if scaled > 0.0 { scaled } else { 0.0 };
        let scaled = if scaled < LAST { scaled } else { LAST };
        // Rounds, and spares the instructions of a cast for values that do not occur.
        (scaled + 8_388_608.0).to_bits() & (Self::SIZE as u32 - 1)
    }

    /// The 8-bit value of a step.
    #[inline(always)]
    pub(super) fn encode(&self, step: u32) -> u8 {
        // The mask changes no step; it spares a check in the innermost loop.
        self.0[step as usize & (Self::SIZE - 1)]
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the sRGB curve and its inverse agree, and the table follows the curve.
    use super::*;

    #[test]
    fn every_8_bit_value_survives_the_way_through_linear_light() {
        let table = SrgbTable::new();
        for value in 0..=255_u8 {
            let light = linear_from_srgb(f32::from(value) / 255.0);
            assert!((srgb_from_linear(light) * 255.0 - f32::from(value)).abs() < 0.01);
            assert_eq!(table.encode(SrgbTable::step(light)), value);
        }
        let encode = |light| table.encode(SrgbTable::step(light));
        assert_eq!((encode(7.0), encode(-1.0), encode(f32::NAN)), (255, 0, 0));
    }
}
