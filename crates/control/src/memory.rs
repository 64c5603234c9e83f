//! State of a controller, as numbers with names.

/// A record of the state between periods, all of it numbers.
///
/// For a memory that is outside: states of generated code, a file, a message.
pub trait Memory<T>: Sized {
    /// The same with every number replaced by what `visit` makes of it: shown the name of the quantity and the number, in a fixed
    /// order. Neighbours of one name are the entries of one table.
    #[must_use]
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self;
}
