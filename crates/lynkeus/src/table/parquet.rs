//! Logs and estimates as Parquet files.

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use ::parquet::basic::{
    Compression, ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical, ZstdLevel,
};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{ByteArray, DataType, DoubleType};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::types::{ColumnDescriptor, Type};

use super::Table;
use super::column::Column;
use super::instant::Instant;
use super::lines::Lines;
use super::marks::FileMarks;
use crate::series::{Iter, Store};
use crate::{Error, Series};

/// Rows that are read or written at a time.
const BATCH: usize = 8192;

/// Rows of a group that is written.
const GROUP: usize = 1 << 20;

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

/// What a column's values mean.
#[derive(Clone, Copy, Debug)]
enum Meaning {
    Number {
        scale: i32,
        unsigned: bool,
    },
    /// a count of so many nanoseconds since 1970
    Time {
        unit: i64,
        zoned: bool,
    },
}

/// Reads a Parquet file; its rows count from 1 in messages.
///
/// # Errors
/// The file is no Parquet file or cut short, has no rows, or there is no room for its numbers.
pub(super) fn load(file: File, name: &str) -> Result<Table, Error> {
    let broken = |e: ParquetError| {
        Error::input(format!("cannot read the Parquet file: {e}"))
            .at(name)
            .hint("it is damaged or cut short, or no Parquet file")
    };
    let reader = SerializedFileReader::new(file).map_err(broken)?;
    let metadata = reader.metadata();
    let rows = usize::try_from(metadata.file_metadata().num_rows()).unwrap_or(usize::MAX);
    let schema = metadata.file_metadata().schema_descr();
    if rows == 0 {
        return Err(Error::input("expected rows, found none").at(name));
    }
    let store = Store::default();
    let mut columns = Vec::new();
    for (index, described) in schema.columns().iter().enumerate() {
        let mut column = Column::new(&described.path().string(), &store);
        if described.max_rep_level() > 0 {
            // a list in every row: no column of numbers
            continue;
        }
        for group in 0..metadata.num_row_groups() {
            let group = reader.get_row_group(group).map_err(broken)?;
            let chunk = group.get_column_reader(index).map_err(broken)?;
            read(chunk, described, &mut column).map_err(broken)?;
            store.check()?;
        }
        column.finish(FileMarks::default());
        columns.push(column);
    }
    Ok(Table {
        file: name.to_owned(),
        columns,
        lines: Lines::counted(rows),
        store,
    })
}

fn read(
    chunk: ColumnReader,
    described: &ColumnDescriptor,
    column: &mut Column,
) -> Result<(), ParquetError> {
    let meaning = meaning(described);
    let levels = described.max_def_level();
    match chunk {
        ColumnReader::DoubleColumnReader(r) => each(r, levels, column, |c, x| c.put(*x)),
        ColumnReader::FloatColumnReader(r) => each(r, levels, column, |c, x| c.put(f64::from(*x))),
        ColumnReader::BoolColumnReader(r) => {
            each(r, levels, column, |c, x| c.put(f64::from(u8::from(*x))))
        }
        ColumnReader::Int32ColumnReader(r) => each(r, levels, column, |c, x| {
            whole(c, i64::from(*x), 32, meaning)
        }),
        ColumnReader::Int64ColumnReader(r) => {
            each(r, levels, column, |c, x| whole(c, *x, 64, meaning))
        }
        ColumnReader::Int96ColumnReader(r) => each(r, levels, column, |c, x| {
            c.put_instant(Instant::at(i128::from(x.to_nanos()), false))
        }),
        ColumnReader::ByteArrayColumnReader(r) => each(r, levels, column, text),
        ColumnReader::FixedLenByteArrayColumnReader(r) => each(r, levels, column, text),
    }
}

/// Takes every value of a chunk.
fn each<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    most: i16,
    column: &mut Column,
    mut take: impl FnMut(&mut Column, &T::T),
) -> Result<(), ParquetError> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    loop {
        values.clear();
        levels.clear();
        let room = (most > 0).then_some(&mut levels);
        let (rows, ..) = reader.read_records(BATCH, room, None, &mut values)?;
        if rows == 0 {
            return Ok(());
        }
        let mut present = values.iter();
        for row in 0..rows {
            let is_null = levels.get(row).is_some_and(|level| *level < most);
            let value = if is_null { None } else { present.next() };
            match value {
                Some(value) => take(column, value),
                None => column.put_nothing(),
            }
        }
    }
}

fn text(column: &mut Column, bytes: &impl AsBytes) {
    let line = column.values.len() as u64 + 1;
    let text = std::str::from_utf8(bytes.as_bytes()).unwrap_or("bytes");
    column.push(text.trim(), line);
}

/// What both kinds of byte arrays are made of.
trait AsBytes {
    fn as_bytes(&self) -> &[u8];
}

impl AsBytes for ByteArray {
    fn as_bytes(&self) -> &[u8] {
        self.data()
    }
}

impl AsBytes for ::parquet::data_type::FixedLenByteArray {
    fn as_bytes(&self) -> &[u8] {
        self.data()
    }
}

fn whole(column: &mut Column, value: i64, bits: u32, meaning: Meaning) {
    match meaning {
        Meaning::Time { unit, zoned } => {
            let nanoseconds = i128::from(value) * i128::from(unit);
            column.put_instant(Instant::at(nanoseconds, zoned));
        }
        Meaning::Number { scale, unsigned } => {
            let value = match (unsigned, bits) {
                (true, 32) => (value & 0xffff_ffff) as f64,
                (true, _) => value.cast_unsigned() as f64,
                _ => value as f64,
            };
            column.put(value / 10_f64.powi(scale));
        }
    }
}

fn meaning(described: &ColumnDescriptor) -> Meaning {
    let time = |unit, zoned| Meaning::Time { unit, zoned };
    let number = |scale, unsigned| Meaning::Number { scale, unsigned };
    match described.logical_type_ref() {
        Some(LogicalType::Timestamp(t)) => {
            let unit = match t.unit {
                TimeUnit::MILLIS => 1_000_000,
                TimeUnit::MICROS => 1000,
                TimeUnit::NANOS => 1,
            };
            return time(unit, t.is_adjusted_to_u_t_c);
        }
        Some(LogicalType::Date) => return time(DAY, false),
        Some(LogicalType::Decimal(d)) => return number(d.scale, false),
        Some(LogicalType::Integer(i)) => return number(0, !i.is_signed),
        _ => {}
    }
    match described.converted_type() {
        ConvertedType::TIMESTAMP_MILLIS => time(1_000_000, true),
        ConvertedType::TIMESTAMP_MICROS => time(1000, true),
        ConvertedType::DATE => time(DAY, false),
        ConvertedType::DECIMAL => number(described.type_scale(), false),
        ConvertedType::UINT_32 | ConvertedType::UINT_64 => number(0, true),
        _ => number(0, false),
    }
}

/// Writes named columns as Parquet, every number exactly, compressed by zstd; a NaN is a null.
///
/// # Errors
/// What the writer reports.
pub fn write_parquet(
    to: &mut (impl Write + Send),
    columns: &[(&str, &Series)],
) -> std::io::Result<()> {
    write(to, columns).map_err(std::io::Error::other)
}

fn write(to: &mut (impl Write + Send), columns: &[(&str, &Series)]) -> Result<(), ParquetError> {
    let field = |(name, _): &(&str, &Series)| {
        let field = Type::primitive_type_builder(name, Physical::DOUBLE);
        let field = field.with_repetition(Repetition::OPTIONAL).build()?;
        Ok(Arc::new(field))
    };
    let fields: Result<Vec<_>, ParquetError> = columns.iter().map(field).collect();
    let schema = Type::group_type_builder("estimates").with_fields(fields?);
    let compression = Compression::ZSTD(ZstdLevel::default());
    let properties = WriterProperties::builder().set_compression(compression);
    let schema = Arc::new(schema.build()?);
    let mut writer = SerializedFileWriter::new(to, schema, Arc::new(properties.build()))?;
    let rows = columns.iter().map(|(_, v)| v.len()).min().unwrap_or(0);
    let mut rest: Vec<Iter<'_>> = columns.iter().map(|(_, values)| values.iter()).collect();
    for from in (0..rows).step_by(GROUP) {
        let mut group = writer.next_row_group()?;
        for values in &mut rest {
            let Some(mut column) = group.next_column()? else {
                continue;
            };
            let mut left = GROUP.min(rows - from);
            while left > 0 {
                let values: Vec<f64> = values.take(left.min(BATCH)).collect();
                let present: Vec<f64> = values.iter().copied().filter(|x| !x.is_nan()).collect();
                let levels: Vec<i16> = values.iter().map(|x| i16::from(!x.is_nan())).collect();
                let typed = column.typed::<DoubleType>();
                typed.write_batch(&present, Some(&levels), None)?;
                left -= values.len().max(1);
            }
            column.close()?;
        }
        group.close()?;
        columns.iter().try_for_each(|(_, values)| checked(values))?;
    }
    writer.close()?;
    Ok(())
}

fn checked(values: &Series) -> Result<(), ParquetError> {
    let failed = |e: Error| ParquetError::External(Box::new(e));
    values.check().map_err(failed)
}

#[cfg(test)]
mod tests;
