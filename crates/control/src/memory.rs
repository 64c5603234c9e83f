//! State of a controller as named numbers.

/// State of a controller as a sequence of named numbers, for generated code, files and messages.
pub trait Memory<T>: Sized {
    /// Replaces every number by the result of `visit`, which receives the quantity's name and the number, in a fixed
    /// order.
    ///
    /// Consecutive numbers of one name are the entries of one table.
    #[must_use]
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self;
}
