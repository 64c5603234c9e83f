//! Fieldbus delay of a whole number of control cycles.

use std::collections::VecDeque;

/// Queue of messages in transit.
#[derive(Clone, Debug)]
pub(crate) struct Fieldbus<M> {
    on_the_way: VecDeque<M>,
}

impl<M: Clone> Fieldbus<M> {
    /// A bus with the given delay \[cycles\], filled with the message `first`.
    pub(crate) fn new(cycles: usize, first: M) -> Self {
        Self { on_the_way: std::iter::repeat_n(first, cycles).collect() }
    }

    /// Delay \[cycles\].
    pub(crate) fn cycles(&self) -> usize {
        self.on_the_way.len()
    }

    /// Sends a message and returns the one that arrives in the same cycle.
    pub(crate) fn exchange(&mut self, message: M) -> M {
        self.on_the_way.push_back(message.clone());
        self.on_the_way.pop_front().unwrap_or(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_arrive_in_order_after_the_delay() {
        let mut bus = Fieldbus::new(2, 0);
        let arrived: Vec<i32> = (1..=5).map(|message| bus.exchange(message)).collect();
        assert_eq!(arrived, [0, 0, 1, 2, 3]);
        assert_eq!(Fieldbus::new(0, 0).exchange(7), 7);
    }
}
