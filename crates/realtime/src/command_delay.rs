//! Delay of commands on their way to a machine, for the simulation beside it.

/// Longest delay \[steps\]: 20 control periods of 20 steps each.
const LONGEST: usize = 400;

/// Delay line of motor speeds: the simulated pump follows the command that acts at the machine now.
///
/// ```
/// # use hydroboom_realtime::command_delay::CommandDelay;
/// let mut delay = CommandDelay::default();
/// delay.set(2);
/// assert_eq!([1.0, 2.0, 3.0, 4.0].map(|speed| delay.push(speed)), [1.0, 1.0, 1.0, 2.0]);
/// ```
#[derive(Clone, Debug)]
pub struct CommandDelay {
    /// Delay \[steps\], at most [`LONGEST`].
    delay: usize,
    /// The last commands \[rev/s\].
    commands: [f64; LONGEST + 1],
    /// Place of the next command.
    next: usize,
    /// Whether no command has come since the start or the last [`clear`](Self::clear).
    is_empty: bool,
}

impl Default for CommandDelay {
    /// No delay.
    fn default() -> Self {
        Self { delay: 0, commands: [0.0; LONGEST + 1], next: 0, is_empty: true }
    }
}

impl CommandDelay {
    /// Sets the delay \[integration steps\]; a longer one than 400 counts as 400. It acts from the next
    /// [`push`](Self::push) on.
    pub fn set(&mut self, steps: usize) {
        self.delay = steps.min(LONGEST);
    }

    /// Forgets all commands in transit: the next one acts at once.
    pub fn clear(&mut self) {
        self.is_empty = true;
    }

    /// Takes the newest command \[rev/s\], and returns the one that acts now \[rev/s\]: that of the delay before. The
    /// first command acts at once. A NaN is passed on like any other. It does not allocate.
    pub fn push(&mut self, command: f64) -> f64 {
        if self.is_empty {
            self.commands.fill(command);
            self.is_empty = false;
        }
        let length = self.commands.len();
        self.commands[self.next] = command;
        let acts = self.commands[(self.next + length - self.delay) % length];
        self.next = (self.next + 1) % length;
        acts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_acts_after_the_delay_and_the_longest_delay_is_kept() {
        for (steps, acts_after) in [(0, 0), (1, 1), (20, 20), (LONGEST, LONGEST), (9999, LONGEST)] {
            let mut delay = CommandDelay::default();
            delay.set(steps);
            let passed: Vec<f64> = (0..1000).map(|k| delay.push(f64::from(k))).collect();
            for (k, acts) in passed.iter().enumerate() {
                assert_eq!(*acts, k.saturating_sub(acts_after) as f64);
            }
            delay.clear();
            assert_eq!(delay.push(-5.0), -5.0);
        }
    }
}
