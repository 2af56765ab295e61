//! A cache of values, which forgets some when there are too many. It is never part of a result: a value that is not
//! kept is made again, and is the same.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Values by key up to a total weight; those that were not asked for longest are forgotten first.
#[derive(Debug)]
pub struct LruCache<K, V> {
    most: usize,
    weigh: fn(&V) -> usize,
    shelf: Mutex<Shelf<K, V>>,
}

#[derive(Debug)]
struct Shelf<K, V> {
    /// Grows with every question.
    now: u64,
    weight: usize,
    values: BTreeMap<K, Place<V>>,
    /// Keys by the time of their last question.
    asked: BTreeMap<u64, K>,
}

/// Place of a value that is made or will be made.
#[derive(Debug)]
struct Place<V> {
    last: u64,
    /// 0 until it is made.
    weight: usize,
    value: Arc<OnceLock<V>>,
}

impl<K: Ord + Clone, V: Clone> LruCache<K, V> {
    /// Keeps at most this many values.
    pub fn new(most: usize) -> LruCache<K, V> {
        LruCache::weighing(most, |_| 1)
    }

    /// Keeps values that together weigh at most so much.
    pub fn weighing(most: usize, weigh: fn(&V) -> usize) -> LruCache<K, V> {
        let shelf = Shelf { now: 0, weight: 0, values: BTreeMap::new(), asked: BTreeMap::new() };
        LruCache { most, weigh, shelf: Mutex::new(shelf) }
    }

    /// The value of a key, made now if it is not kept. Other threads that ask for the same one wait for it.
    pub fn of(&self, key: K, make: impl FnOnce() -> V) -> V {
        let place = self.shelf().ask(key.clone());
        let mut made = false;
        let value = place.get_or_init(|| {
            made = true;
            make()
        });
        if made {
            self.shelf().weighed(&key, (self.weigh)(value), self.most);
        }
        value.clone()
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf<K, V>> {
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<K: Ord + Clone, V> Shelf<K, V> {
    fn ask(&mut self, key: K) -> Arc<OnceLock<V>> {
        self.now += 1;
        let now = self.now;
        let place =
            self.values.entry(key.clone()).or_insert_with(|| Place { last: now, weight: 0, value: Arc::default() });
        self.asked.remove(&place.last);
        place.last = now;
        self.asked.insert(now, key);
        place.value.clone()
    }

    fn weighed(&mut self, key: &K, weight: usize, most: usize) {
        let Some(place) = self.values.get_mut(key) else { return };
        place.weight = weight;
        self.weight += weight;
        while self.weight > most
            && let Some((_, oldest)) = self.asked.pop_first()
            && let Some(gone) = self.values.remove(&oldest)
        {
            self.weight -= gone.weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_made_is_not_made_again_until_too_much_is_kept() {
        let kept = LruCache::new(4);
        let of = |key: u64, value: f64| kept.of(key, || value);
        assert_eq!((of(0, 1.0), of(0, 2.0)), (1.0, 1.0));
        (1..4).for_each(|key| assert_eq!(of(key, 3.0), 3.0));
        assert_eq!((of(0, 2.0), of(9, 4.0)), (1.0, 4.0), "asked for again, so another one is forgotten");
        assert_eq!((of(0, 2.0), of(1, 5.0)), (1.0, 5.0));
    }

    #[test]
    fn heavy_values_push_out_many_and_what_is_too_heavy_is_not_kept() {
        let kept: LruCache<u8, Vec<u8>> = LruCache::weighing(10, Vec::len);
        let of = |key: u8, length: usize, fill: u8| kept.of(key, || vec![fill; length])[0];
        assert_eq!((of(0, 4, 1), of(1, 4, 1), of(2, 6, 1)), (1, 1, 1));
        assert_eq!((of(1, 4, 2), of(2, 6, 2)), (1, 1), "the first alone had to go");
        assert_eq!((of(3, 20, 1), of(3, 20, 2), of(1, 4, 3)), (1, 2, 3));
        assert_eq!((of(1, 4, 4), kept.shelf().weight), (3, 4));
    }
}
