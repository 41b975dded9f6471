//! Datasets put together by hand, for what no build makes yet: every type and encoding, every
//! primitive, refinement by replacement, normal cones, pages of few nodes.

use lodestream_protocol::{
    Attribute, Boot, Domain, GroupInfo, HierarchyPage, Lattice, LatticeBox, Manifest, Method,
    MortonCode, Node, NodeKey, NormalCone, PageRef, PayloadRef, Primitive, Refinement, ScalarType,
    Storage, encode_column, encode_positions,
};

/// A dataset and what it shows.
pub struct Handmade {
    /// What it shows.
    pub name: String,
    /// The file.
    pub bytes: Vec<u8>,
}

/// All of them.
pub fn all() -> Vec<Handmade> {
    let mut all = Vec::new();
    // Nodes of 32 and 31 bits a side have wide Morton codes; nodes of 12 and 11 have narrow ones.
    for side_bits in [12, 32] {
        // Few elements are stored raw, many through pco.
        for elements in [5, 700] {
            for primitive in
                [Primitive::Point, Primitive::Disc, Primitive::Ellipse, Primitive::Rectangle]
            {
                let name = format!("{elements} of {primitive:?}, {side_bits} bits a side");
                let bytes = Maker { side_bits, elements, primitive, seed: 7 }.dataset();
                all.push(Handmade { name, bytes });
            }
        }
    }
    all.push(Handmade {
        name: "no element at all".to_owned(),
        bytes: Maker { side_bits: 12, elements: 0, primitive: Primitive::Point, seed: 7 }.dataset(),
    });
    all
}

struct Maker {
    side_bits: u8,
    /// Elements in each of the three nodes.
    elements: usize,
    primitive: Primitive,
    seed: u64,
}

/// Texels of every rectangle: columns, rows.
const TEXTURE: [u32; 2] = [3, 2];

impl Maker {
    fn dataset(mut self) -> Vec<u8> {
        let lattice = Lattice {
            // Numbers that only an exact reading of all their 17 digits brings back.
            scale: 0.001_000_000_000_000_000_2,
            offset: [406.590_000_000_000_03, 5_000_000.000_000_001, -0.5],
            origin: [-7, 1 << 40, 12],
            side_bits: self.side_bits,
        };
        let attributes = self.attributes();
        let root = NodeKey::ROOT;
        let keys = [root, root.child(2).expect("a child"), root.child(5).expect("a child")];
        let keys = if self.elements == 0 { &keys[..0] } else { &keys[..] };
        let mut bounds = LatticeBox::EMPTY;
        let mut nodes = Vec::new();
        let mut payloads = [Vec::new(), Vec::new()];
        let mut groups =
            ["base", "more"].map(|name| GroupInfo { name: name.to_owned(), columns: Vec::new() });
        groups[0].columns.push(0);
        for group in attributes.iter().filter_map(Attribute::group) {
            groups[group].columns.push(0);
        }
        for &key in keys {
            let (node, of_node) = self.node(key, &lattice, &attributes, &mut groups);
            bounds.merge(&node.bounds);
            for (all, one) in payloads.iter_mut().zip(of_node) {
                all.push(one);
            }
            nodes.push(node);
        }
        if let Some(root) = nodes.first_mut() {
            root.child_mask = 1 << 2 | 1 << 5;
            root.bounds = bounds;
        }

        // The children's page lies behind all payloads.
        let group_bytes = |group: usize| payloads[group].iter().map(|p: &Vec<u8>| p.len() as u64);
        let totals: Vec<u64> = (0..2).map(|group| group_bytes(group).sum()).collect();
        let page_at = |first: usize| -> Vec<u64> {
            (0..2)
                .map(|g| totals[..g].iter().sum::<u64>() + group_bytes(g).take(first).sum::<u64>())
                .collect()
        };
        let mut tail: Vec<u8> = payloads.iter().flatten().flatten().copied().collect();
        if let Some((root, children)) = nodes.split_first_mut() {
            let page = HierarchyPage::encode(children, page_at(1), &lattice).expect("a page");
            root.child_page = Some(PageRef {
                offset: tail.len() as u64,
                bytes: u32::try_from(page.len()).expect("small"),
                nodes: 2,
                crc: crc32fast::hash(&page),
            });
            tail.extend(page);
        }
        let root_page = &nodes[..nodes.len().min(1)];
        let root_page = HierarchyPage::encode(root_page, page_at(0), &lattice).expect("a page");
        let manifest = Manifest {
            generator: "a test".to_owned(),
            points: (keys.len() * self.elements) as u64,
            nodes: keys.len() as u64,
            levels: if keys.is_empty() { 0 } else { 2 },
            refinement: Refinement::Replace,
            primitive: self.primitive,
            method: Method { name: "by hand".to_owned(), grid: 1, leaf_capacity: 1 },
            lattice,
            bounds,
            largest_rounding: 0.0,
            attributes,
            groups: groups.into(),
            fine: None,
            crs: None,
            sources: Vec::new(),
        };
        let mut file = Boot::encode(&manifest, &root_page, 0, tail.len() as u64).expect("an index");
        file.extend(tail);
        file
    }

    /// What the primitive needs, in group 0; then an attribute of every type, one that each node
    /// has but one value of, and a constant.
    fn attributes(&self) -> Vec<Attribute> {
        let mut attributes = Vec::new();
        let mut add = |name: &str, scalar, components, domain, storage| {
            let (min, max) = (Vec::new(), Vec::new());
            let name = name.to_owned();
            attributes.push(Attribute { name, scalar, components, domain, storage, min, max });
        };
        let column = |group| Storage::Column { group };
        for &(name, components) in self.primitive.required_attributes() {
            let scalar = match name {
                "texture_size" => ScalarType::U16,
                "texel_color" => ScalarType::U8,
                _ => ScalarType::F32,
            };
            let domain = if name == "texel_color" { Domain::Texel } else { Domain::Element };
            add(name, scalar, components, domain, column(0));
        }
        if self.primitive == Primitive::Rectangle {
            add("texel_height", ScalarType::I16, 1, Domain::Texel, column(0));
        }
        add("color", ScalarType::U16, 3, Domain::Element, column(0));
        add("color_8", ScalarType::U8, 3, Domain::Element, column(1));
        for scalar in ScalarType::ALL {
            add(&format!("one_{scalar:?}"), scalar, 1, Domain::Element, column(1));
            add(&format!("two_{scalar:?}"), scalar, 2, Domain::Element, column(1));
        }
        add("same_in_a_node", ScalarType::I32, 2, Domain::Element, column(1));
        let constant = Attribute::constant_storage(&[1, 2, 3, 4, 5, 6]);
        add("constant", ScalarType::U16, 3, Domain::Element, constant);
        attributes
    }

    /// A node without children and its payloads; the bytes of its columns are added to `groups`.
    fn node(
        &mut self,
        key: NodeKey,
        lattice: &Lattice,
        attributes: &[Attribute],
        groups: &mut [GroupInfo; 2],
    ) -> (Node, [Vec<u8>; 2]) {
        let bits = lattice.node_bits(key.level());
        let corner = lattice.node_min(key);
        let mut bounds = LatticeBox::EMPTY;
        let mut positions: Vec<[u32; 3]> = Vec::new();
        for _ in 0..self.elements {
            let random = [self.random(), self.random(), self.random()];
            let position = random.map(|r| (r & ((1 << bits) - 1)) as u32);
            bounds.grow(std::array::from_fn(|axis| corner[axis] + position[axis]));
            positions.push(position);
        }
        let mut codes: Vec<u128> = positions.into_iter().map(MortonCode::encode).collect();
        codes.sort_unstable();

        let mut payloads = [Vec::new(), Vec::new()];
        encode_positions(&mut payloads[0], &codes, bits).expect("positions");
        groups[0].columns[0] += payloads[0].len() as u64;
        let mut columns = [1, 0];
        for attribute in attributes {
            let Some(group) = attribute.group() else { continue };
            let values = self.values(attribute);
            let before = payloads[group].len();
            encode_column(&mut payloads[group], attribute, &values).expect("a column");
            groups[group].columns[columns[group]] += (payloads[group].len() - before) as u64;
            columns[group] += 1;
        }
        let reference = |payload: &Vec<u8>| PayloadRef {
            offset: 0,
            bytes: u32::try_from(payload.len()).expect("small"),
            crc: crc32fast::hash(payload),
        };
        let node = Node {
            key,
            child_mask: 0,
            points: u32::try_from(self.elements).expect("small"),
            bounds,
            geometric_error: 0.0,
            spacing: 0.25,
            normal_cone: attributes.iter().any(Attribute::is_normal).then_some(NormalCone::ANY),
            payloads: payloads.iter().map(reference).collect(),
            child_page: None,
        };
        (node, payloads)
    }

    fn values(&mut self, attribute: &Attribute) -> Vec<u8> {
        let texels = TEXTURE.iter().product::<u32>() as usize;
        let count = match attribute.domain {
            Domain::Element => self.elements,
            Domain::Texel => self.elements * texels,
        };
        let mut values = Vec::new();
        for i in 0..count * usize::from(attribute.components) {
            let random = match attribute.name.as_str() {
                "texture_size" => u64::from(TEXTURE[i % 2]),
                "same_in_a_node" => u64::MAX,
                _ => self.random(),
            };
            match attribute.scalar {
                // Any bits would do, but for a NaN, whose bits need not survive a conversion.
                ScalarType::F32 => values.extend(((random % 1000) as f32 / 7.0).to_le_bytes()),
                ScalarType::F64 => values.extend(((random % 1000) as f64 / 7.0).to_le_bytes()),
                scalar => values.extend(&random.to_le_bytes()[..scalar.size_bytes()]),
            }
        }
        values
    }

    /// The next number of a xorshift generator (Marsaglia 2003).
    fn random(&mut self) -> u64 {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 7;
        self.seed ^= self.seed << 17;
        self.seed
    }
}
