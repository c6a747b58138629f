//! Estimates as Parquet files.

use std::io::Write;
use std::sync::Arc;

use ::parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
use ::parquet::data_type::DoubleType;
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::types::Type;

use super::BATCH;
use crate::Series;
use crate::series::Iter;
use lynkeus_answer::Error;

/// Rows of a group that is written.
const GROUP: usize = 1 << 20;

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
    let properties = WriterProperties::builder()
        .set_compression(compression)
        .set_created_by(concat!("lynkeus version ", env!("CARGO_PKG_VERSION")).to_owned());
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
