//! Projector response: codes at the knots of a table's response section.

use iltm_picture::{DeviceResponse, ProjectorResponse};
use iltm_runtime::response::{CODES, RESPONSE_KNOTS, ResponseCurve, code_of_index, knot_drive};

/// The codes, full scale 65,535, of every knot's drive, one curve after the other:
/// one for all channels, or one for each of the table's `channels`. `None` for a
/// linear projector, whose table needs no response.
#[must_use]
pub fn knots(response: &ProjectorResponse, channels: usize) -> Option<Vec<u16>> {
    if response.is_linear() {
        return None;
    }
    let curves = if response.channels().len() == 1 {
        1
    } else {
        channels
    };
    let curves = (0..curves).map(|channel| curve(response.channel(channel)));
    Some(curves.flatten().collect())
}

fn curve(response: &DeviceResponse) -> Vec<u16> {
    let code = |knot| response.value(knot_drive(knot).to_num()) * f64::from(u16::MAX);
    (0..RESPONSE_KNOTS)
        .map(|knot| code(knot).round() as u16)
        .collect()
}

/// The 8-bit codes of a response given by its knots.
#[must_use]
pub fn codes(knots: &[u16]) -> Vec<u8> {
    let knots: Vec<[u8; 2]> = knots.iter().map(|code| code.to_le_bytes()).collect();
    let curves = knots.chunks_exact(RESPONSE_KNOTS).map(ResponseCurve::new);
    let of_curve = |response| (0..CODES).map(move |index| code_of_index(index, response));
    curves.flat_map(of_curve).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Response;

    #[test]
    fn knots_rise_from_dark_to_white() {
        let knots = knots(&Response::Srgb.into(), 3).expect("not linear");
        assert_eq!((knots[0], knots[RESPONSE_KNOTS - 1]), (0, u16::MAX));
        assert!(knots.is_sorted());
        assert_eq!(knots.len(), RESPONSE_KNOTS);
        assert_eq!(super::knots(&Response::Linear.into(), 3), None);
    }

    #[test]
    fn a_projector_whose_channels_differ_has_a_curve_each_for_those_of_the_table() {
        let of = [Response::Srgb, Response::Gamma(2.2), Response::Linear];
        let projector = ProjectorResponse::of_channels(of.map(Into::into).into()).expect("three");
        let all = knots(&projector, 3).expect("not linear");
        for (channel, response) in of.into_iter().enumerate() {
            let own = &all[channel * RESPONSE_KNOTS..][..RESPONSE_KNOTS];
            assert_eq!(own, curve(&response.into()), "{response}");
        }
        let grey = knots(&projector, 1).expect("not linear");
        assert_eq!(grey, curve(&Response::Srgb.into()));
    }
}
