//! Colours of figures, consistent for each strategy.

use crate::closed_loop::controller_choice::ControllerChoice;
use hydroboom_control::strategy::Strategy;
use plotters::style::RGBColor;

/// Medium colours that are distinguishable on white and on black and with colour blindness (after Okabe and
/// Ito). Strategies use them in the order of [`Strategy::ALL`].
pub(super) const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(150, 130, 20),
];

/// Index of the neutral colour, for a reference or a limit.
pub const NEUTRAL: usize = usize::MAX;
const GREY: RGBColor = RGBColor(122, 130, 140);

/// Index of a strategy's colour in the palette: its place in [`Strategy::ALL`].
pub fn colour_of(strategy: Strategy) -> usize {
    Strategy::ALL.iter().position(|s| *s == strategy).unwrap_or(NEUTRAL)
}

/// Index of a controller: that of its strategy, or an index beyond the palette, whose colours then repeat.
pub(super) fn colour_of_controller(controller: ControllerChoice) -> usize {
    controller.place()
}

/// Colour of an index.
pub(super) fn paint(place: usize) -> RGBColor {
    match place {
        NEUTRAL => GREY,
        place => COLOURS[place % COLOURS.len()],
    }
}
