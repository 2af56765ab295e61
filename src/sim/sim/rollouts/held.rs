//! A value that an episode needs but need not own: borrowed for a rollout that ends where it began, or shared, for an
//! episode that is kept beside others and outlives its caller.

use std::ops::Deref;
use std::sync::Arc;

/// A borrowed or shared value.
#[derive(Debug)]
pub enum Held<'a, T> {
    /// Borrowed for as long as the borrow lasts.
    Borrowed(&'a T),
    /// Shared for as long as it is wanted.
    Shared(Arc<T>),
}

impl<T> Deref for Held<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        match self {
            Held::Borrowed(held) => held,
            Held::Shared(held) => held,
        }
    }
}

impl<T> Clone for Held<'_, T> {
    fn clone(&self) -> Self {
        match self {
            Held::Borrowed(held) => Held::Borrowed(held),
            Held::Shared(held) => Held::Shared(held.clone()),
        }
    }
}

impl<'a, T> From<&'a T> for Held<'a, T> {
    fn from(held: &'a T) -> Self {
        Held::Borrowed(held)
    }
}

impl<T> From<Arc<T>> for Held<'_, T> {
    fn from(held: Arc<T>) -> Self {
        Held::Shared(held)
    }
}
