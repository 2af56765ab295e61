//! The reading of the fields of a file's road users: in the convention in which they are written, or in one that the user names.

/// Times of a log's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SampleTimes {
    /// The log's times; motion is resampled where they lie beside the grid of 0.1 s.
    #[default]
    Recorded,
    /// One sample every so many seconds, whatever the log says.
    Every(f64),
}

/// How a field is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReadAs {
    /// As it is written, or in the one convention in which it surely is.
    #[default]
    Judged,
    /// In the convention of this place in its table.
    Known(usize),
    /// Not at all: it is derived from places.
    Derived,
}

impl ReadAs {
    /// Returns the convention that the user names; the written one where the field is derived, `None` where it is to be judged.
    pub fn named(self) -> Option<usize> {
        match self {
            ReadAs::Judged => None,
            ReadAs::Known(convention) => Some(convention),
            ReadAs::Derived => Some(0),
        }
    }
}

/// How the fields of a file's road users are read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conventions {
    /// Times of samples, of formats that have times.
    pub times: SampleTimes,
    /// Headings.
    pub headings: ReadAs,
    /// Velocities.
    pub velocities: ReadAs,
}
