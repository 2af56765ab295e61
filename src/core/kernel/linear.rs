//! Products of matrices of `f32` with the same bits everywhere: every sum runs by ascending inner index, with one rounding per
//! multiplication and one per addition, so that the compiler may put neighbouring columns into one register and no more.
//!
//! Zeros of the left factor are passed over: after a ReLU half of it is zero. A sum without its zero terms is the same
//! sum, as long as the right factor is finite.

/// Columns that are summed side by side: eight registers of four.
const WIDE: usize = 32;
/// Columns that are summed side by side in the remainder.
const NARROW: usize = 4;

/// A left factor by rows, without its zeros, and room for the right one in blocks of columns. Reused, so that a product
/// allocates nothing once it is warm.
#[derive(Clone, Debug, Default)]
pub struct Product {
    values: Vec<f32>,
    places: Vec<u32>,
    /// Row r is `starts[r]..starts[r + 1]`.
    starts: Vec<usize>,
    block: Vec<f32>,
}

impl Product {
    /// Takes `left` (rows by `inner`, row after row) as the left factor.
    pub fn of_rows(&mut self, left: &[f32], inner: usize) -> &mut Product {
        self.clear(left.len());
        let mut count = 0;
        for row in left.chunks_exact(inner.max(1)) {
            for (i, &x) in row.iter().enumerate() {
                self.values[count] = x;
                self.places[count] = i as u32;
                count += usize::from(x != 0.0);
            }
            self.starts.push(count);
        }
        self
    }

    /// Takes the transpose of `left` (its rows by `columns`) as the left factor.
    pub fn of_columns(&mut self, left: &[f32], columns: usize) -> &mut Product {
        self.clear(left.len());
        let mut count = 0;
        for column in 0..columns {
            for (i, &x) in left[column.min(left.len())..].iter().step_by(columns).enumerate() {
                self.values[count] = x;
                self.places[count] = i as u32;
                count += usize::from(x != 0.0);
            }
            self.starts.push(count);
        }
        self
    }

    fn clear(&mut self, count: usize) {
        // One more place: a term that is not kept is written behind the last one kept.
        self.values.resize(count + 1, 0.0);
        self.places.resize(count + 1, 0);
        self.starts.clear();
        self.starts.push(0);
    }

    /// Adds the product with `right` (inner by `columns`, row after row) to `out` (rows by `columns`). The sums begin with
    /// the values in `out`.
    pub fn add_to(&mut self, right: &[f32], columns: usize, out: &mut [f32]) {
        let mut from = 0;
        while from < columns {
            let left = columns - from;
            let width = if left >= WIDE { WIDE } else { NARROW };
            self.pack(right, columns, from, width);
            match width {
                WIDE => self.columns::<WIDE>(columns, from, out),
                _ => self.columns::<NARROW>(columns, from, out),
            }
            from += width;
        }
    }

    /// Copies a block of columns, padded with zeros, so that its rows lie one behind the other.
    fn pack(&mut self, right: &[f32], columns: usize, from: usize, width: usize) {
        let to = (from + width).min(columns);
        self.block.clear();
        for row in right.chunks_exact(columns) {
            self.block.extend_from_slice(&row[from..to]);
            self.block.extend(std::iter::repeat_n(0.0, width - (to - from)));
        }
    }

    fn columns<const WIDTH: usize>(&self, columns: usize, from: usize, out: &mut [f32]) {
        let to = (from + WIDTH).min(columns);
        let (block, _) = self.block.as_chunks::<WIDTH>();
        for (range, row) in self.starts.windows(2).zip(out.chunks_exact_mut(columns)) {
            let kept = range[0]..range[1];
            let mut sums = [0.0; WIDTH];
            sums[..to - from].copy_from_slice(&row[from..to]);
            let (fours, rest) = self.values[kept.clone()].as_chunks::<4>();
            let (places, last) = self.places[kept].as_chunks::<4>();
            for (x, place) in fours.iter().zip(places) {
                add_four(&mut sums, x, place.map(|i| &block[i as usize]));
            }
            for (&x, &place) in rest.iter().zip(last) {
                add_one(&mut sums, x, &block[place as usize]);
            }
            row[from..to].copy_from_slice(&sums[..to - from]);
        }
    }
}

/// Adds four terms to each sum, one after the other. A function of its own, so that the compiler sees a loop over
/// neighbours in memory and takes four at once; inside its caller it was seen to take them one by one.
#[inline(never)]
fn add_four<const WIDTH: usize>(sums: &mut [f32; WIDTH], x: &[f32; 4], rows: [&[f32; WIDTH]; 4]) {
    let [a, b, c, d] = rows;
    for j in 0..WIDTH {
        sums[j] = sums[j] + x[0] * a[j] + x[1] * b[j] + x[2] * c[j] + x[3] * d[j];
    }
}

#[inline(never)]
fn add_one<const WIDTH: usize>(sums: &mut [f32; WIDTH], x: f32, row: &[f32; WIDTH]) {
    for j in 0..WIDTH {
        sums[j] += x * row[j];
    }
}

/// The transpose of a matrix (its rows by `columns`), row after row.
pub fn transposed(matrix: &[f32], columns: usize) -> Vec<f32> {
    (0..columns).flat_map(|column| matrix[column..].iter().step_by(columns).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    fn drawn(count: usize, name: &str) -> Vec<f32> {
        let mut stream = Seed(3).stream(&["linear", name]);
        let value = |stream: &mut crate::kernel::rng::Stream| stream.uniform(-1.0, 1.0) as f32;
        (0..count).map(|_| value(&mut stream).max(-0.3)).map(|x| if x == -0.3 { 0.0 } else { x }).collect()
    }

    /// The sums of a product by their definition, in `f32` and in the same order.
    fn plain(left: &[f32], inner: usize, right: &[f32], columns: usize, out: &mut [f32]) {
        for (row, sums) in left.chunks_exact(inner).zip(out.chunks_exact_mut(columns)) {
            for (j, sum) in sums.iter_mut().enumerate() {
                for (i, x) in row.iter().enumerate() {
                    *sum += x * right[i * columns + j];
                }
            }
        }
    }

    #[test]
    fn a_product_has_the_bits_of_its_definition_at_every_width() {
        for columns in [1, 2, 4, 5, 31, 32, 33, 70] {
            let (left, right) = (drawn(7 * 9, "left"), drawn(9 * columns, "right"));
            let mut expected = drawn(7 * columns, "bias");
            let mut found = expected.clone();
            plain(&left, 9, &right, columns, &mut expected);
            Product::default().of_rows(&left, 9).add_to(&right, columns, &mut found);
            assert_eq!(found, expected, "{columns} columns");
            // The transpose of the transpose is the matrix again.
            let mut turned = drawn(7 * columns, "bias");
            Product::default().of_columns(&transposed(&left, 9), 7).add_to(&right, columns, &mut turned);
            assert_eq!(turned, expected, "{columns} columns, transposed");
        }
    }
}
