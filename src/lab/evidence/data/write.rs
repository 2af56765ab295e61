//! Tables as bytes: CSV by the crate `csv`, Parquet by the crate `parquet`. The same table gives the same bytes.

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::sync::Arc;

use super::sheet::{Cell, Heading, Kind, Sheet};

/// Rows that a reader of Parquet takes at once.
const GROUP_ROWS: usize = 65_536;

/// A cell that does not fit its column, or a table too large to write.
#[derive(Debug, thiserror::Error)]
#[error("table {table} cannot be written: {reason}")]
pub struct WriteError {
    table: &'static str,
    reason: String,
}

impl Sheet {
    fn failed(&self, reason: impl ToString) -> WriteError {
        WriteError { table: self.name, reason: reason.to_string() }
    }

    /// Writes CSV with a header; missing values are empty, booleans `true` and `false`, numbers as short as they read back.
    pub fn csv(&self) -> Result<Vec<u8>, WriteError> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.headings.iter().map(|h| h.name.as_str())).map_err(|error| self.failed(error))?;
        for row in &self.rows {
            writer.write_record(row.iter().map(printed)).map_err(|error| self.failed(error))?;
        }
        writer.into_inner().map_err(|error| self.failed(error))
    }

    /// Columns that may be missing, compressed by none: the numbers are few, and every reader has it.
    pub fn parquet(&self) -> Result<Vec<u8>, WriteError> {
        self.as_parquet().map_err(|error| self.failed(error))
    }

    fn as_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let fields = self.headings.iter().map(|heading| field(heading).map(Arc::new)).collect::<Result<Vec<_>, _>>()?;
        let schema = Arc::new(Type::group_type_builder(self.name).with_fields(fields).build()?);
        let properties =
            WriterProperties::builder().set_compression(Compression::UNCOMPRESSED).set_created_by("evodrive".into());
        let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties.build()))?;
        for rows in self.rows.chunks(GROUP_ROWS) {
            let mut group = writer.next_row_group()?;
            for (place, heading) in self.headings.iter().enumerate() {
                column(&mut group, heading.kind, rows.iter().map(|row| &row[place]))?;
            }
            group.close()?;
        }
        writer.into_inner()
    }
}

fn printed(cell: &Cell) -> String {
    match cell {
        Cell::Nothing => String::new(),
        Cell::Text(text) => text.clone(),
        Cell::Number(number) => number.to_string(),
        Cell::Whole(whole) => whole.to_string(),
        Cell::Flag(flag) => flag.to_string(),
    }
}

fn field(heading: &Heading) -> Result<Type, ParquetError> {
    let physical = match heading.kind {
        Kind::Text => Physical::BYTE_ARRAY,
        Kind::Number => Physical::DOUBLE,
        Kind::Whole => Physical::INT64,
        Kind::Flag => Physical::BOOLEAN,
    };
    let logical = (heading.kind == Kind::Text).then_some(LogicalType::String);
    let field = Type::primitive_type_builder(&heading.name, physical).with_repetition(Repetition::OPTIONAL);
    field.with_logical_type(logical).build()
}

fn column<'c>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    kind: Kind,
    cells: impl Iterator<Item = &'c Cell>,
) -> Result<(), ParquetError> {
    match kind {
        Kind::Text => values::<ByteArrayType>(
            group,
            cells.map(|cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            }),
        ),
        Kind::Number => values::<DoubleType>(
            group,
            cells.map(|cell| match cell {
                Cell::Number(number) => Some(*number),
                _ => None,
            }),
        ),
        Kind::Whole => values::<Int64Type>(
            group,
            cells.map(|cell| match cell {
                Cell::Whole(whole) => Some(*whole),
                _ => None,
            }),
        ),
        Kind::Flag => values::<BoolType>(
            group,
            cells.map(|cell| match cell {
                Cell::Flag(flag) => Some(*flag),
                _ => None,
            }),
        ),
    }
}

fn values<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    cells: impl Iterator<Item = Option<T::T>>,
) -> Result<(), ParquetError> {
    let Some(mut writer) = group.next_column()? else {
        return Err(ParquetError::General("there are more columns than the schema has".into()));
    };
    let (mut present, mut levels) = (Vec::new(), Vec::new());
    for cell in cells {
        levels.push(i16::from(cell.is_some()));
        present.extend(cell);
    }
    writer.typed::<T>().write_batch(&present, Some(&levels), None)?;
    writer.close()
}
