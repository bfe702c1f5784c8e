//! Projector codes at the knots of a table's response section.

use crate::capture::Response;
use iltm_runtime::pipeline::{
    CODES, RESPONSE_KNOTS, Response as RuntimeResponse, codes, knot_drive,
};

/// The code, full scale 65,535, of every knot's drive; `None` for a linear
/// projector, whose table needs no response.
#[must_use]
pub fn knots(response: Response) -> Option<Vec<u16>> {
    if response == Response::Linear {
        return None;
    }
    let code = |knot| response.value(knot_drive(knot).to_num()) * f64::from(u16::MAX);
    Some(
        (0..RESPONSE_KNOTS)
            .map(|knot| code(knot).round() as u16)
            .collect(),
    )
}

/// The 8-bit codes of a response given by its knots.
#[must_use]
pub fn codes(knots: &[u16]) -> Vec<u8> {
    let knots: Vec<[u8; 2]> = knots.iter().map(|code| code.to_le_bytes()).collect();
    let curves = knots.chunks_exact(RESPONSE_KNOTS).map(RuntimeResponse::new);
    let of_curve = |response| (0..CODES).map(move |index| codes::code(index, response));
    curves.flat_map(of_curve).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_rise_from_dark_to_white() {
        let knots = knots(Response::Srgb).expect("not linear");
        assert_eq!((knots[0], knots[RESPONSE_KNOTS - 1]), (0, u16::MAX));
        assert!(knots.is_sorted());
        assert_eq!(super::knots(Response::Linear), None);
    }
}
