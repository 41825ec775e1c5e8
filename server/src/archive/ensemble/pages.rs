//! Pages of a Parquet file from elsewhere, looked at before any is unpacked: how large each says it becomes, and
//! that there is nothing in it that this program does not write. What a page says binds its reader, so that a
//! small file cannot fill the memory.

use parquet::basic::{Compression, Type};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use std::fs::File;
use std::os::unix::fs::FileExt;

/// Largest page, unpacked, bytes: a thousand profiles of the finest grid fit, and a thousand of the longest texts.
const MOST_PAGE_BYTES: i64 = 128 << 20;
/// Most bytes of a number with its levels, and of what else a page of numbers has.
const NUMBER_BYTES: i64 = 16;
const PAGE_BYTES: i64 = 1 << 16;
/// Largest dictionary, unpacked, bytes: each of its texts may stand in every row.
const MOST_DICTIONARY_BYTES: i64 = 4 << 20;
/// Most numbers of a column in a group of rows.
const MOST_VALUES: i64 = 1 << 25;
/// Most bytes of a page's header.
const HEADER_BYTES: usize = 1 << 16;
/// Encodings that are written here: plain, run lengths, dictionaries. Others make much of little.
const ENCODINGS: [i64; 4] = [0, 2, 3, 8];
/// That of real numbers besides: their bytes by weight, as many as there are.
const BYTE_STREAM_SPLIT: i64 = 9;

/// Looks at all pages; what is wrong as a sentence.
pub fn check(file: &File, length: u64, metadata: &ParquetMetaData) -> Result<(), String> {
    for group in metadata.row_groups() {
        for column in group.columns() {
            check_column(file, length, column, group.num_rows())
                .map_err(|why| format!("its column {}: {why}", column.column_path().string()))?;
        }
    }
    Ok(())
}

fn check_column(
    file: &File,
    length: u64,
    column: &ColumnChunkMetaData,
    rows: i64,
) -> Result<(), String> {
    if !matches!(column.compression(), Compression::ZSTD(_) | Compression::UNCOMPRESSED) {
        return Err("it is compressed otherwise than by zstd".into());
    }
    let told = column.num_values();
    let described = column.column_descr();
    let is_flat = described.max_rep_level() == 0;
    if told < rows || told > MOST_VALUES || (is_flat && told != rows) {
        return Err(format!("{told} values in {rows} rows"));
    }
    let first = column.dictionary_page_offset().filter(|o| *o > 0).unwrap_or(i64::MAX);
    let first = first.min(column.data_page_offset());
    let (Ok(mut at), Ok(bytes)) = (u64::try_from(first), u64::try_from(column.compressed_size()))
    else {
        return Err("it begins before the file".into());
    };
    let end = at.checked_add(bytes).filter(|end| *end <= length);
    let end = end.ok_or("it ends behind the file")?;
    let mut values = 0;
    while at < end {
        let mut header = vec![0; HEADER_BYTES.min((end - at) as usize)];
        file.read_exact_at(&mut header, at).map_err(|e| e.to_string())?;
        let page = Page::read(&header).ok_or("the header of a page cannot be read")?;
        if page.values < 0 || page.values > told {
            return Err(format!("a page of {} values", page.values));
        }
        let most = match described.physical_type() {
            _ if page.is_dictionary => MOST_DICTIONARY_BYTES,
            Type::BYTE_ARRAY => MOST_PAGE_BYTES,
            _ => MOST_PAGE_BYTES.min(NUMBER_BYTES * page.values + PAGE_BYTES),
        };
        if !(0..=most).contains(&page.unpacked) {
            return Err(format!("a page of {} bytes, and at most {most} are taken", page.unpacked));
        }
        let is_split =
            page.encoding == BYTE_STREAM_SPLIT && described.physical_type() == Type::DOUBLE;
        if !is_split && !ENCODINGS.contains(&page.encoding) {
            return Err("it is encoded in a way that is not read here".into());
        }
        let packed = u64::try_from(page.packed).map_err(|_| "a page of less than nothing")?;
        if !page.is_dictionary {
            values += page.values;
        }
        at = at.saturating_add(page.header_bytes as u64).saturating_add(packed);
    }
    if at != end || values != told {
        return Err(format!("its pages have {values} values and should have {told}"));
    }
    Ok(())
}

/// What the header of a page says.
struct Page {
    is_dictionary: bool,
    unpacked: i64,
    packed: i64,
    values: i64,
    encoding: i64,
    header_bytes: usize,
}

impl Page {
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut thrift = Thrift { bytes, at: 0 };
        let fields = thrift.structure(0)?;
        let whole = |fields: &[(i64, Field)], wanted: i64| {
            fields.iter().find_map(|(id, field)| match field {
                Field::Whole(n) if *id == wanted => Some(*n),
                _ => None,
            })
        };
        let inner = |wanted: i64| {
            fields.iter().find_map(|(id, field)| match field {
                Field::Struct(inner) if *id == wanted => Some(inner),
                _ => None,
            })
        };
        // Field numbers of the format's PageHeader: type, sizes, then one header for each type.
        let (page_type, unpacked, packed) =
            (whole(&fields, 1)?, whole(&fields, 2)?, whole(&fields, 3)?);
        let (inner, encoding) = match page_type {
            0 => (inner(5)?, 2),
            2 => (inner(7)?, 2),
            3 => (inner(8)?, 4),
            _ => return None,
        };
        Some(Self {
            is_dictionary: page_type == 2,
            unpacked,
            packed,
            values: whole(inner, 1)?,
            encoding: whole(inner, encoding)?,
            header_bytes: thrift.at,
        })
    }
}

/// A field of a structure; others than these are passed over.
enum Field {
    Whole(i64),
    Struct(Vec<(i64, Field)>),
    Other,
}

/// Thrift's compact protocol, as far as headers of pages need it.
struct Thrift<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let n = self.varint()?;
        Some((n >> 1) as i64 ^ -((n & 1) as i64))
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        let end = self.at.checked_add(usize::try_from(bytes).ok()?)?;
        self.at = Some(end).filter(|end| *end <= self.bytes.len())?;
        Some(())
    }

    fn structure(&mut self, depth: usize) -> Option<Vec<(i64, Field)>> {
        /// Headers have two levels; statistics none below.
        const DEEPEST: usize = 4;
        if depth > DEEPEST {
            return None;
        }
        let (mut fields, mut id) = (Vec::new(), 0_i64);
        loop {
            let byte = self.byte()?;
            if byte == 0 {
                return Some(fields);
            }
            let step = i64::from(byte >> 4);
            id = if step == 0 { self.zigzag()? } else { id + step };
            let field = match byte & 0xf {
                1 | 2 => Field::Other,
                3 => {
                    self.byte()?;
                    Field::Other
                }
                4..=6 => Field::Whole(self.zigzag()?),
                7 => {
                    self.pass(8)?;
                    Field::Other
                }
                8 => {
                    let length = self.varint()?;
                    self.pass(length)?;
                    Field::Other
                }
                12 => Field::Struct(self.structure(depth + 1)?),
                // Lists, sets and maps have no place in the header of a page.
                _ => return None,
            };
            fields.push((id, field));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_and_what_is_cut_is_none() {
        // type 0, unpacked 100, packed 50, data header {values 7, encoding 0, levels 3 and 3}.
        let header =
            [0x15, 0, 0x15, 200, 1, 0x15, 100, 0x2c, 0x15, 14, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0];
        let page = Page::read(&header).expect("a header");
        let told = (page.unpacked, page.packed, page.values, page.header_bytes);
        assert_eq!(told, (100, 50, 7, header.len()));
        for n in 0..header.len() {
            assert!(Page::read(&header[..n]).is_none(), "{n}");
        }
        // A text that is longer than what is there; a structure without end.
        assert!(Page::read(&[0x18, 0xff, 0xff, 0xff, 0xff, 0x7f]).is_none());
        assert!(Page::read(&[0x1c; 64]).is_none());
    }
}
