//! Colours of figures: one for each strategy in all of them.

use crate::closed_loop::controller_choice::ControllerChoice;
use hydroboom_control::strategy::Strategy;
use plotters::style::RGBColor;

/// Mid-tone colours that can be told apart on white and on black, also without colour vision
/// (after Okabe and Ito); strategies have them in the order of [`Strategy::ALL`].
pub(super) const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(150, 130, 20),
];

/// The colour of a reference, and of a limit, which is no strategy's.
pub const NEUTRAL: usize = usize::MAX;
const GREY: RGBColor = RGBColor(122, 130, 140);

/// The place in the palette of a strategy.
pub fn colour_of(strategy: Strategy) -> usize {
    Strategy::ALL.iter().position(|s| *s == strategy).unwrap_or(NEUTRAL)
}

/// The place of a controller: that of its strategy, or beyond the palette, which begins anew.
pub(super) fn colour_of_controller(controller: ControllerChoice) -> usize {
    controller.place()
}

/// The colour of a place.
pub(super) fn paint(place: usize) -> RGBColor {
    match place {
        NEUTRAL => GREY,
        place => COLOURS[place % COLOURS.len()],
    }
}
