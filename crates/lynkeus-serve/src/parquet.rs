//! A day of the history as a Parquet file, once it is over.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;

use ::parquet::basic::{
    Compression, LogicalType, Repetition, TimeUnit, Type as Physical, ZstdLevel,
};
use ::parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::record::Field;
use ::parquet::schema::types::Type;
use lynkeus::table::Instant;

use crate::bytes::beside;

/// The headers of the columns that are no numbers, but for the time.
pub(crate) const ASSET: &str = "asset";
pub(crate) const CREDIBLE: &str = "credible";
pub(crate) const REVISION: &str = "revision";

/// Rows of a group.
const GROUP: usize = 1 << 17;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Number,
    /// in UTC, or by a clock of which nobody knows
    Date {
        is_zoned: bool,
    },
    Text,
    Truth,
    Count,
}

/// Writes the lines of a CSV file as Parquet, every number to the bit; the file is there once it is whole.
///
/// # Errors
/// What was written cannot be read, or the disk is full.
pub(crate) fn convert(from: &Path, to: &Path) -> io::Result<()> {
    let new = beside(to, ".new");
    let done = written(from, &new).and_then(|()| std::fs::rename(&new, to));
    if done.is_err() {
        // it may never have been made
        let _ = std::fs::remove_file(&new);
    }
    done
}

/// Whether a file holds the lines of a CSV file, each number to the bit.
///
/// # Errors
/// One of them cannot be read, or the disk is full.
pub(crate) fn is_of(path: &Path, from: &Path) -> io::Result<bool> {
    let reader = SerializedFileReader::new(File::open(path)?).map_err(io::Error::other)?;
    let mut lines = csv::Reader::from_path(from)?;
    let names = lines.headers()?.clone();
    let schema = reader.metadata().file_metadata().schema();
    let columns = schema.get_fields().iter().map(|field| field.name());
    if !columns.eq(&names) {
        return Ok(false);
    }
    let kinds = kinds(from, &names)?;
    let mut records = lines.records();
    for row in reader.get_row_iter(None).map_err(io::Error::other)? {
        let row = row.map_err(io::Error::other)?;
        let Some(record) = records.next().transpose()? else {
            return Ok(false);
        };
        let cells = record.iter().zip(&kinds);
        let mut pairs = row.get_column_iter().map(|(_, field)| field).zip(cells);
        if !pairs.all(|(field, (cell, kind))| is_in(field, cell, *kind)) {
            return Ok(false);
        }
    }
    Ok(records.next().is_none())
}

/// Whether a field holds what a cell says.
fn is_in(field: &Field, cell: &str, kind: Kind) -> bool {
    let number = |cell: &str| cell.parse::<f64>().ok().map(f64::to_bits);
    match (kind, field) {
        (Kind::Number, Field::Double(x)) => number(cell) == Some(x.to_bits()),
        (Kind::Number, Field::Null) => number(cell).is_none(),
        (Kind::Date { .. }, Field::Long(t)) => date(cell).is_some_and(|(own, _)| own == *t),
        (Kind::Text, Field::Str(text)) => text == cell,
        (Kind::Truth, Field::Bool(truth)) => cell.parse() == Ok(*truth),
        (Kind::Count, Field::Long(count)) => cell.parse() == Ok(*count),
        _ => false,
    }
}

fn written(from: &Path, to: &Path) -> io::Result<()> {
    let mut reader = csv::Reader::from_path(from)?;
    let names = reader.headers()?.clone();
    let kinds = kinds(from, &names)?;
    let file = File::create(to)?;
    let mut writer = writer(&file, &names, &kinds).map_err(io::Error::other)?;
    let mut records = reader.records();
    loop {
        let group: Result<Vec<_>, csv::Error> = records.by_ref().take(GROUP).collect();
        let group = group?;
        if group.is_empty() {
            break;
        }
        let mut to = writer.next_row_group().map_err(io::Error::other)?;
        for (place, kind) in kinds.iter().enumerate() {
            let cells = group
                .iter()
                .map(|record| record.get(place).unwrap_or_default());
            column(&mut to, *kind, cells).map_err(io::Error::other)?;
        }
        to.close().map_err(io::Error::other)?;
    }
    writer.close().map_err(io::Error::other)?;
    file.sync_all()
}

/// What the columns of a file hold.
fn kinds(from: &Path, names: &csv::StringRecord) -> io::Result<Vec<Kind>> {
    let time = time(from)?;
    let last = names.len().saturating_sub(2);
    let kinds = names.iter().enumerate().map(|(place, name)| match name {
        _ if place == 0 => time,
        ASSET if place == 1 => Kind::Text,
        CREDIBLE if place >= last => Kind::Truth,
        REVISION if place >= last => Kind::Count,
        _ => Kind::Number,
    });
    Ok(kinds.collect())
}

/// What the times of a file are: numbers, dates of one kind, or texts where they differ.
fn time(from: &Path) -> io::Result<Kind> {
    let mut reader = csv::Reader::from_path(from)?;
    let mut found = None;
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record)? {
        let cell = record.get(0).unwrap_or_default();
        let own = match (cell.parse::<f64>(), date(cell)) {
            (Ok(_), _) => Kind::Number,
            (_, Some((_, is_zoned))) => Kind::Date { is_zoned },
            _ => Kind::Text,
        };
        if found.is_some_and(|found| found != own) {
            return Ok(Kind::Text);
        }
        found = Some(own);
    }
    Ok(found.unwrap_or(Kind::Number))
}

/// A date in nanoseconds since 1970, and whether it is in UTC.
fn date(cell: &str) -> Option<(i64, bool)> {
    let instant = Instant::read(cell)?;
    Some((
        i64::try_from(instant.nanoseconds()).ok()?,
        instant.is_zoned(),
    ))
}

fn writer<'f>(
    file: &'f File,
    names: &csv::StringRecord,
    kinds: &[Kind],
) -> Result<SerializedFileWriter<&'f File>, ParquetError> {
    let fields = names.iter().zip(kinds).map(|(name, kind)| {
        let (physical, logical) = match kind {
            Kind::Number => (Physical::DOUBLE, None),
            Kind::Date { is_zoned } => (
                Physical::INT64,
                Some(LogicalType::timestamp(*is_zoned, TimeUnit::NANOS)),
            ),
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Kind::Truth => (Physical::BOOLEAN, None),
            Kind::Count => (Physical::INT64, None),
        };
        let field = Type::primitive_type_builder(name, physical);
        let field = field.with_repetition(Repetition::OPTIONAL);
        Ok(Arc::new(field.with_logical_type(logical).build()?))
    });
    let fields: Result<Vec<_>, ParquetError> = fields.collect();
    let schema = Type::group_type_builder("history").with_fields(fields?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by(concat!("lynkeus version ", env!("CARGO_PKG_VERSION")).to_owned());
    SerializedFileWriter::new(
        file,
        Arc::new(schema.build()?),
        Arc::new(properties.build()),
    )
}

/// Writes a column; a cell that holds nothing of its kind is a null.
fn column<'c>(
    to: &mut SerializedRowGroupWriter<'_, &File>,
    kind: Kind,
    cells: impl Iterator<Item = &'c str>,
) -> Result<(), ParquetError> {
    let Some(mut writer) = to.next_column()? else {
        return Ok(());
    };
    macro_rules! write {
        ($type:ty, $read:expr) => {{
            let read: Vec<Option<_>> = cells.map($read).collect();
            let levels: Vec<i16> = read.iter().map(|x| i16::from(x.is_some())).collect();
            let present: Vec<_> = read.into_iter().flatten().collect();
            writer
                .typed::<$type>()
                .write_batch(&present, Some(&levels), None)?;
        }};
    }
    match kind {
        Kind::Number => write!(DoubleType, |cell| cell.parse().ok()),
        Kind::Date { .. } => write!(Int64Type, |cell| date(cell).map(|(t, _)| t)),
        Kind::Text => write!(ByteArrayType, |cell| Some(ByteArray::from(cell))),
        Kind::Truth => write!(BoolType, |cell| cell.parse().ok()),
        Kind::Count => write!(Int64Type, |cell| cell.parse().ok()),
    }
    writer.close()?;
    Ok(())
}
