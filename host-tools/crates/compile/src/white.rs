//! Reference white: what a wanted 255 means in camera units.

use iltm_solve::InverseTransport;

/// What limits the reference white.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ReferenceWhite {
    /// Light of reference white, camera units.
    pub light: f64,
    /// The cell that reaches the projector's white first.
    pub cell: usize,
    /// The channel in which it does.
    pub channel: usize,
}

/// The brightest uniform grey, the same in all channels, that every live cell
/// reaches without clipping; `None` if there is no such cell or light.
///
/// For a wanted light `w` everywhere, cell `i` needs
/// `p_i = w s_i - t_i` with `s = g - K 1` and `t = g a - K a`, so it reaches
/// `w <= (1 + t_i) / s_i`.
#[must_use]
pub fn reference_white(inverse: &InverseTransport) -> Option<ReferenceWhite> {
    let mut lowest: Option<ReferenceWhite> = None;
    for (index, channel) in inverse.channels.iter().enumerate() {
        let operator = inverse.channel(index).operator;
        let live = |cell: usize| inverse.live.get(cell).copied().unwrap_or(false);
        for cell in (0..inverse.grid.cells()).filter(|cell| live(*cell)) {
            let row = operator.row(cell);
            let (mut slope, mut offset) = (
                channel.gain[cell],
                channel.gain[cell] * channel.ambient[cell],
            );
            for (source, value) in row.iter().enumerate().filter(|(source, _)| live(*source)) {
                slope -= value;
                offset -= value * channel.ambient[source];
            }
            if slope <= 0.0 {
                continue;
            }
            let light = (1.0 + offset) / slope;
            if light.is_finite() && light > 0.0 && lowest.is_none_or(|low| light < low.light) {
                lowest = Some(ReferenceWhite {
                    light,
                    cell,
                    channel: index,
                });
            }
        }
    }
    lowest
}
