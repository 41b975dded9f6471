//! The PLY header: format, elements, properties, and where the data start.

use lodestream_protocol::ScalarType;

use crate::readers::text::lines;

/// Longest header that is looked for.
pub(super) const MAX_HEADER_BYTES: usize = 1 << 20;

/// Most properties of an element; more is a broken file.
const MAX_PROPERTIES: usize = 1024;

/// How values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Decimal text, one line per item of an element.
    Ascii,
    /// Binary, least significant byte first.
    LittleEndian,
    /// Binary, most significant byte first.
    BigEndian,
}

/// Type of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PropertyKind {
    /// One number.
    Scalar(ScalarType),
    /// A count, then so many numbers.
    List {
        /// Type of the count.
        count: ScalarType,
        /// Type of the numbers.
        item: ScalarType,
    },
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    /// Name, as written.
    pub name: String,
    /// Type.
    pub kind: PropertyKind,
}

/// An element: a table of items that all have the same properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    /// Name, as written.
    pub name: String,
    /// Items announced.
    pub count: u64,
    /// Properties, in file order.
    pub properties: Vec<Property>,
}

/// A parsed header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    /// How values are written.
    pub encoding: Encoding,
    /// Elements, in file order.
    pub elements: Vec<Element>,
    /// Offset of the first byte after the header.
    pub data_offset: usize,
    /// Lines of the header.
    pub lines: u64,
}

impl Header {
    /// Parses the header that `head`, the first bytes of a file, starts with.
    ///
    /// # Errors
    /// What is wrong, and on which line.
    pub fn parse(head: &[u8]) -> Result<Self, String> {
        const BOM: &[u8] = b"\xef\xbb\xbf";
        let start = if head.starts_with(BOM) { BOM.len() } else { 0 };
        // One terminator for all of the header: "\r" alone must not swallow a first data byte 0x0a,
        // and "\r\n" must not leave one behind.
        let terminator = lines::terminator_of(&head[start..]);
        let mut header =
            Self { encoding: Encoding::Ascii, elements: Vec::new(), data_offset: start, lines: 0 };
        let mut encoding = None;
        while let Some(length) = memchr::memchr(terminator, &head[header.data_offset..]) {
            let line = &head[header.data_offset..header.data_offset + length];
            header.data_offset += length + 1;
            header.lines += 1;
            let number = header.lines;
            let line = String::from_utf8_lossy(line);
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if number == 1 {
                if words != ["ply"] {
                    return Err(NOT_PLY.to_owned());
                }
                continue;
            }
            match words[..] {
                [] | ["comment" | "obj_info", ..] => {}
                ["end_header"] => {
                    header.encoding =
                        encoding.ok_or("the header has no format line: not a whole PLY file")?;
                    return Ok(header);
                }
                ["format", name, version] => {
                    encoding = Some(parse_encoding(name, version, number)?);
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| {
                        format!("header line {number}: {count:?} is no count of {name} items")
                    })?;
                    let properties = Vec::new();
                    header.elements.push(Element { name: name.to_owned(), count, properties });
                }
                ["property", ref kind @ .., name] => {
                    let element = header.elements.last_mut().ok_or_else(|| {
                        format!("header line {number}: property {name} stands before any element")
                    })?;
                    if element.properties.len() == MAX_PROPERTIES {
                        return Err(format!(
                            "header line {number}: element {} has more than {MAX_PROPERTIES} \
                             properties",
                            element.name
                        ));
                    }
                    let kind = parse_kind(kind, name, number)?;
                    element.properties.push(Property { name: name.to_owned(), kind });
                }
                _ => {
                    return Err(format!(
                        "header line {number} is not understood: {:?}",
                        line.trim().chars().take(60).collect::<String>()
                    ));
                }
            }
        }
        if !head[start..].starts_with(b"ply") {
            return Err(NOT_PLY.to_owned());
        }
        Err(format!("the header has no end_header line in the first {} bytes", head.len()))
    }

    /// The element of that name and its index.
    pub fn element(&self, name: &str) -> Option<(usize, &Element)> {
        self.elements.iter().enumerate().find(|(_, element)| element.name == name)
    }
}

const NOT_PLY: &str = "not a PLY file: it does not start with a line \"ply\"";

fn parse_encoding(name: &str, version: &str, line: u64) -> Result<Encoding, String> {
    if version != "1.0" {
        return Err(format!("header line {line}: PLY version {version} is not known, only 1.0 is"));
    }
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(format!(
            "header line {line}: format {name} is not known (ascii, binary_little_endian and \
             binary_big_endian are)"
        )),
    }
}

fn parse_kind(words: &[&str], name: &str, line: u64) -> Result<PropertyKind, String> {
    let scalar = |word: &str| {
        parse_scalar(word).ok_or_else(|| {
            format!("header line {line}: property {name} has the type {word}, which is not known")
        })
    };
    match *words {
        [kind] => Ok(PropertyKind::Scalar(scalar(kind)?)),
        ["list", count, item] => {
            let (count, item) = (scalar(count)?, scalar(item)?);
            if matches!(count, ScalarType::F32 | ScalarType::F64) {
                return Err(format!(
                    "header line {line}: list {name} counts its items in floating point"
                ));
            }
            Ok(PropertyKind::List { count, item })
        }
        _ => Err(format!("header line {line}: the type of property {name} is not understood")),
    }
}

/// The types of Turk's description, the sized names that came after, and what writers built on
/// NumPy add: 64-bit integers and `bool` (one byte).
fn parse_scalar(word: &str) -> Option<ScalarType> {
    Some(match word {
        "char" | "int8" => ScalarType::I8,
        "uchar" | "uint8" | "bool" => ScalarType::U8,
        "short" | "int16" => ScalarType::I16,
        "ushort" | "uint16" => ScalarType::U16,
        "int" | "int32" => ScalarType::I32,
        "uint" | "uint32" => ScalarType::U32,
        "int64" => ScalarType::I64,
        "uint64" => ScalarType::U64,
        "float" | "float32" => ScalarType::F32,
        "double" | "float64" => ScalarType::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CUBE: &str = "ply\nformat binary_big_endian 1.0\ncomment made by hand\nobj_info a cube\n\
        element face 12\nproperty list uchar int vertex_indices\nelement vertex 8\n\
        property float x\nproperty float64 y\nproperty int z\nend_header\n";

    #[test]
    fn reads_elements_in_any_order_with_lists() {
        let header = Header::parse(CUBE.as_bytes()).expect("a header");
        assert_eq!(header.encoding, Encoding::BigEndian);
        assert_eq!((header.data_offset, header.lines), (CUBE.len(), 11));
        let (index, vertex) = header.element("vertex").expect("vertices");
        assert_eq!((index, vertex.count), (1, 8));
        let kinds: Vec<PropertyKind> = vertex.properties.iter().map(|p| p.kind).collect();
        assert_eq!(
            kinds,
            [ScalarType::F32, ScalarType::F64, ScalarType::I32].map(PropertyKind::Scalar)
        );
        assert_eq!(
            header.elements[0].properties[0].kind,
            PropertyKind::List { count: ScalarType::U8, item: ScalarType::I32 }
        );
    }

    #[test]
    fn every_line_end_leaves_the_first_data_byte_alone() {
        for end in ["\n", "\r\n", "\r"] {
            let head = CUBE.replace('\n', end) + "\n data";
            let header = Header::parse(head.as_bytes()).expect(end);
            assert_eq!(&head[header.data_offset..], "\n data");
        }
        // A header of line feeds whose last line ends otherwise, as one exporter writes it.
        let head = CUBE.replace("end_header\n", "end_header\r\n") + "\n data";
        let header = Header::parse(head.as_bytes()).expect("mixed");
        assert_eq!(&head[header.data_offset..], "\n data");
    }

    #[test]
    fn blanks_and_a_byte_order_mark_do_no_harm() {
        let head = "\u{feff}ply \nformat ascii 1.0\n\nelement  vertex\t1 \nend_header \n";
        assert_eq!(Header::parse(head.as_bytes()).expect("a header").data_offset, head.len());
    }

    #[test]
    fn says_what_is_wrong_and_where() {
        let wrong = |from: &str, to: &str| {
            Header::parse(CUBE.replace(from, to).as_bytes()).expect_err("refused")
        };
        assert!(wrong("ply\n", "plyx\n").starts_with("not a PLY file"));
        assert!(wrong("element face 12", "element face -1").contains("line 5: \"-1\""));
        assert!(wrong("float x", "quaternion x").contains("line 8: property x has the type quat"));
        assert!(wrong("float x", "list float int x").contains("floating point"));
        assert!(wrong("binary_big_endian", "gzip").contains("line 2: format gzip"));
        assert!(wrong("1.0", "2.0").contains("version 2.0"));
        assert!(wrong("format binary_big_endian 1.0\n", "").contains("no format line"));
        assert!(wrong("element face 12\n", "").contains("before any element"));
        assert!(wrong("comment", "remark").contains("line 3 is not understood"));
        assert!(wrong("end_header\n", "").contains("no end_header"));
        assert!(Header::parse(b"").expect_err("empty").starts_with("not a PLY file"));
    }

    proptest! {
        #[test]
        fn never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut head = b"ply\nformat ascii 1.0\n".to_vec();
            head.extend(bytes);
            let _ = Header::parse(&head);
        }
    }
}
