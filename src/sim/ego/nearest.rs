//! The nearest of many, in room that is asked for once.

/// Up to `COUNT` items, the nearest first.
pub struct Nearest<T, const COUNT: usize> {
    kept: [Option<(f64, T)>; COUNT],
    count: usize,
    most: usize,
}

impl<T: Copy, const COUNT: usize> Nearest<T, COUNT> {
    /// Keeps the nearest `most`, of which there are `COUNT` at most.
    pub fn new(most: usize) -> Self {
        Nearest { kept: [None; COUNT], count: 0, most: most.min(COUNT) }
    }

    /// Adds an item by its squared distance; of two that are equally near the first one comes first.
    pub fn see(&mut self, squared: f64, what: T) {
        let farther = |of: &Option<(f64, T)>| of.as_ref().is_none_or(|(at, _)| squared < *at);
        let last = self.kept[..self.count].last();
        if self.count == self.most && last.is_none_or(|of| !farther(of)) {
            return;
        }
        let place = self.kept[..self.count].partition_point(|of| !farther(of));
        self.count = (self.count + 1).min(self.most);
        self.kept[place..self.count].rotate_right(1);
        self.kept[place] = Some((squared, what));
    }

    /// Returns what is kept.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.kept[..self.count].iter().flatten().map(|(_, what)| what)
    }
}
