#!/usr/bin/env python3
"""Reads a lodestream dataset (NAME.lods): a second reader, written from FORMAT.md alone.

    python3 read_lods.py NAME.lods                  counts, bounds, a checksum over all elements
    python3 read_lods.py NAME.lods --json           the same, for programs
    python3 read_lods.py NAME.lods --csv OUT.csv    every element's position and attributes

It reads everything, and believes nothing: every checksum, count and order that the document promises is
checked. It needs the standard library and `pip install pcodec` (which brings numpy).

The checksum does not depend on the order of the nodes. It is the sum, modulo 2^64, of the CRC-32 of every
element: its world coordinates as three little-endian f64, then its attributes in the manifest's order,
constants too; and of the CRC-32 of every texel, its attributes likewise.
"""

import argparse
import csv
import json
import math
import struct
import sys
import zlib
from dataclasses import dataclass, field

import numpy as np
from pcodec import standalone as pco

MAGIC = b"LODS\r\n\x1a\n"
TYPES = {"u8": "<u1", "i8": "<i1", "u16": "<u2", "i16": "<i2", "u32": "<u4", "i32": "<i4", "u64": "<u8",
         "i64": "<i8", "f32": "<f4", "f64": "<f8"}


def require(condition, message):
    """Everything the document promises is checked with this."""
    if not condition:
        raise ValueError(message)


# --- index -------------------------------------------------------------------------------------------------


@dataclass
class Index:
    """Header, manifest and root page."""

    manifest: dict
    root_page: bytes
    end: int  # offset of the first byte after the index
    content_id: str
    column_bytes: list  # of the nodes read so far: per group, per column
    cones: dict = field(default_factory=dict)  # of the nodes read so far, by level and cube


def read_index(file):
    header = file.read(64)
    require(len(header) == 64 and header[:8] == MAGIC, "not a lodestream dataset")
    (major, minor, header_bytes, manifest_bytes, root_page_bytes, boot_bytes, file_bytes, content_id, index_crc,
     header_crc) = struct.unpack("<HHIIIQQ16sII", header[8:])
    require(header_crc == zlib.crc32(header[:60]), "the header is damaged")
    require(major <= 2, f"version {major}.{minor} is newer than this reader")
    require(header_bytes == 64, "the header has another length")
    require(file_bytes == file.seek(0, 2), "the file has another length than its header says")
    end = 64 + manifest_bytes + root_page_bytes
    require(end <= boot_bytes <= file_bytes, "the lengths in the header contradict each other")
    file.seek(64)
    manifest = file.read(manifest_bytes)
    root_page = file.read(root_page_bytes)
    require(index_crc == zlib.crc32(manifest + root_page), "the index is damaged")
    manifest = json.loads(manifest)
    fine_group = manifest["fine"]["group"] if "fine" in manifest else None
    with_positions = (0, fine_group)
    groups = range(len(manifest["groups"]))
    sizes = [[0] * (int(group in with_positions) + len(group_columns(manifest, group))) for group in groups]
    if fine_group is not None and manifest["fine"].get("color"):
        sizes[fine_group].append(0)
    return Index(manifest, root_page, end, content_id.hex(), sizes)


# --- hierarchy ---------------------------------------------------------------------------------------------


@dataclass
class Node:
    """A cube of the octree and where its payloads are."""

    level: int
    cube: tuple  # integer cube coordinates
    child_mask: int = 0
    points: int = 0
    bounds: bytes = b""  # slices: lowest x, y, z, highest x, y, z
    geometric_error: float = 0.0
    spacing: float = 0.0
    normal_cone: bytes = b""
    payloads: list = field(default_factory=list)  # per group: offset from the end of the index, length, CRC-32
    child_page: tuple = ()  # offset from the end of the index, length, nodes, CRC-32

    def children(self):
        (x, y, z) = self.cube
        for octant in range(8):
            if self.child_mask >> octant & 1:
                cube = (2 * x + (octant & 1), 2 * y + (octant >> 1 & 1), 2 * z + (octant >> 2 & 1))
                yield Node(self.level + 1, cube)


class Cursor:
    """Takes values off the front of bytes."""

    def __init__(self, data):
        self.data = data
        self.at = 0

    def take(self, length):
        require(self.at + length <= len(self.data), "bytes end before what they announce")
        self.at += length
        return self.data[self.at - length:self.at]

    def u32(self):
        return int.from_bytes(self.take(4), "little")

    def integer(self):
        """An integer of more than 8 bits, as bincode 2 writes it."""
        first = self.take(1)[0]
        if first <= 250:
            return first
        require(first <= 0xFD, "an integer is too long")
        return int.from_bytes(self.take({0xFB: 2, 0xFC: 4, 0xFD: 8}[first]), "little")

    def integers(self):
        return [self.integer() for _ in range(self.integer())]

    def arrays(self, size):
        return [self.take(size) for _ in range(self.integer())]

    def page_references(self):
        return [(self.integer(), self.integer(), self.integer(), self.integer(),
                 self.u32()) for _ in range(self.integer())]

    def finish(self):
        require(self.at == len(self.data), "bytes are left over")


def read_page(data, first_nodes, groups):
    """The nodes of a page that starts with `first_nodes`, breadth first."""
    page = Cursor(data)
    group_offsets = page.integers()
    masks = page.arrays(1)
    points = page.integers()
    bounds = page.arrays(6)
    errors = page.arrays(4)
    spacings = page.arrays(4)
    cones = page.arrays(3)
    payload_bytes = page.integers()
    payload_crcs = page.arrays(4)
    references = page.page_references()
    page.finish()

    count = len(masks)
    require(len(group_offsets) == groups, "a page has offsets for another number of groups")
    require({len(points), len(bounds), len(errors), len(spacings)} == {count}, "a page's sequences differ in length")
    require(len(cones) in (0, count), "a page has cones for some nodes only")
    require(len(payload_bytes) == len(payload_crcs) == count * groups, "a page has another number of payloads")
    require(references == sorted(references), "a page's references are not in order")

    child_pages = {node: rest for node, *rest in references}
    nodes = list(first_nodes)
    for i in range(count):
        require(i < len(nodes), "a page has more nodes than its child masks tell of")
        node = nodes[i]
        node.child_mask = masks[i][0]
        node.points = points[i]
        node.bounds = bounds[i]
        (node.geometric_error,) = struct.unpack("<f", errors[i])
        (node.spacing,) = struct.unpack("<f", spacings[i])
        node.normal_cone = cones[i] if cones else b""
        for group in range(groups):
            length = payload_bytes[i * groups + group]
            crc = int.from_bytes(payload_crcs[i * groups + group], "little")
            node.payloads.append((group_offsets[group], length, crc))
            group_offsets[group] += length
        if i in child_pages:
            node.child_page = tuple(child_pages.pop(i))
        else:
            nodes.extend(node.children())
    require(len(nodes) == count, "a page lacks nodes that its child masks tell of")
    require(not child_pages, "a page refers to children of nodes that it does not have")
    return nodes


def read_tree(file, index):
    """All nodes, page by page."""
    groups = len(index.manifest["groups"])
    root = [Node(0, (0, 0, 0))] if index.manifest["nodes"] else []
    pages = [(index.root_page, root)]
    while pages:
        (data, first_nodes) = pages.pop(0)
        nodes = read_page(data, first_nodes, groups)
        yield from nodes
        for node in nodes:
            if node.child_page:
                (offset, length, count, crc) = node.child_page
                data = read_bytes(file, index.end + offset, length, crc, "a hierarchy page")
                pages.append((data, list(node.children())))


def read_bytes(file, offset, length, crc, what):
    file.seek(offset)
    data = file.read(length)
    require(len(data) == length, f"{what} lies beyond the end of the file")
    require(zlib.crc32(data) == crc, f"{what} is damaged")
    return data


# --- columns -----------------------------------------------------------------------------------------------


def stream(column, dtype, count):
    """Numbers in pco's standalone format, with their length before them."""
    numbers = pco.simple_decompress(column.take(column.u32()))
    require(numbers.dtype == np.dtype(dtype) and len(numbers) == count, "a stream holds other numbers than announced")
    return numbers


def read_values(encoding, data, dtype, components, count):
    """The values of an attribute: an array of `count` rows."""
    column = Cursor(data)
    size = np.dtype(dtype).itemsize * components
    if encoding == 0:
        values = np.tile(np.frombuffer(column.take(size), dtype), (count, 1))
    elif encoding == 1:
        values = np.frombuffer(column.take(count * size), dtype).reshape(count, components)
    elif encoding == 2:
        values = np.stack([stream(column, dtype, count) for _ in range(components)], axis=1)
    elif encoding == 3:
        require(components == 3 and dtype in ("<u1", "<u2"), "only three u8 or u16 can be a colour")
        (middle, low, high) = (stream(column, dtype, count) for _ in range(3))
        values = np.stack([middle + low, middle, middle + high], axis=1)  # wraps, as it should
    elif encoding == 8:
        require(components == 3 and dtype in ("<u1", "<u2"), "only three u8 or u16 can be a colour")
        (step, most, *low_bits) = struct.unpack("<HH3B", column.take(7))
        require(step > 0 and step * most <= np.iinfo(dtype).max, "colours are larger than their type")
        require(max(low_bits) <= 16, "colours lack more bits than they have")
        told = [stream(column, "<i4", count).astype(np.int64) for _ in range(3)]
        (middle, low, high) = ((v << bits) + (1 << bits) // 2 for v, bits in zip(told, low_bits))
        shown = np.stack([middle + low, middle, middle + high], axis=1)
        values = (np.clip(shown, 0, most) * step).astype(dtype)
    else:
        raise ValueError(f"encoding {encoding} is not one of an attribute")
    column.finish()
    return values


def read_fine_colors(encoding, data, coarse):
    """The exact colours: what coarse ones lack is added, modulo the width of a channel."""
    require(encoding == 9, f"encoding {encoding} is not one of fine colours")
    column = Cursor(data)
    (step,) = struct.unpack("<H", column.take(2))
    (middle, low, high) = (stream(column, "<i4", len(coarse)).astype(np.int64) for _ in range(3))
    column.finish()
    missing = np.stack([middle + low, middle, middle + high], axis=1) * step
    return (coarse.astype(np.int64) + missing).astype(coarse.dtype)


def read_positions(encoding, data, count):
    """Positions relative to the node's lowest corner, or cells: an array of `count` rows of three integers, and log2 of
    the side of the cells."""
    cell_bits = 0
    if encoding == 1:
        return read_values(encoding, data, "<u4", 3, count).astype(np.uint64), cell_bits
    column = Cursor(data)
    if encoding == 4:
        codes = [int(code) for code in stream(column, "<u8", count)]
    elif encoding == 5:
        codes = wide_codes(column, count)
    elif encoding == 6:
        cell_bits = column.take(1)[0]
        codes = [int(code) for code in stream(column, "<u8", count)]
    else:
        raise ValueError(f"encoding {encoding} is not one of positions")
    column.finish()
    return coordinates_of(codes), cell_bits


def read_fine_positions(encoding, data, count):
    """Where in their cells the elements lie, and log2 of the side of these."""
    require(encoding == 7, f"encoding {encoding} is not one of fine positions")
    column = Cursor(data)
    cell_bits = column.take(1)[0]
    if cell_bits > 21:
        codes = wide_codes(column, count)
    else:
        dtype = "<u2" if cell_bits <= 5 else "<u4" if cell_bits <= 10 else "<u8"
        codes = [int(code) for code in stream(column, dtype, count)]
    column.finish()
    require(all(code >> 3 * cell_bits == 0 for code in codes), "an element is outside of its cell")
    return coordinates_of(codes), cell_bits


def wide_codes(column, count):
    (high, low) = (stream(column, "<u8", count) for _ in range(2))
    return [int(h) << 48 | int(l) for h, l in zip(high, low)]


def coordinates_of(codes):
    return np.array([[every_third_bit(code >> axis) for axis in range(3)] for code in codes], np.uint64)


def cell_bits_of(manifest, node):
    """log2 of the side of a node's cells, as its level and spacing have it."""
    lattice = manifest["lattice"]
    bits = lattice["side_bits"] - node.level
    side = node.spacing / lattice["scale"] / manifest["fine"]["cells_per_spacing"]
    log2 = math.frexp(side)[1] - 1 if side >= 1 else 0
    return max(min(log2, max(bits - 8, 0)), bits - 21)


def every_third_bit(code):
    """Bits 0, 3, 6, … of an integer, next to one another."""
    return int(bin(code)[:1:-1][::3][::-1], 2)


def morton_code(x, y, z):
    spread = [int(bin(c)[2:], 8) for c in (int(x), int(y), int(z))]  # binary digits, read as octal ones
    return spread[0] | spread[1] << 1 | spread[2] << 2


def read_node(file, index, node):
    """Positions relative to the root's corner, and values by attribute name."""
    manifest = index.manifest
    positions = np.zeros((0, 3), np.uint64)
    values = {}
    texels = 0
    cell_bits = 0
    coarse_color = False
    fine_group = manifest["fine"]["group"] if "fine" in manifest else None
    for group, (offset, length, crc) in enumerate(node.payloads):
        expected = bool(node.points) and (group != fine_group or cell_bits > 0 or coarse_color)
        require(bool(length) == expected, "a payload without elements, or elements without a payload")
        payload = Cursor(read_bytes(file, index.end + offset, length, crc, "a payload"))
        sizes = index.column_bytes[group]
        if group == 0 and length:
            (positions, cell_bits) = read_positions(*take_column(payload), node.points)
            require(not cell_bits or cell_bits == cell_bits_of(manifest, node), "cells are not as large as they should be")
            sizes[0] += payload.at
        if group == fine_group and cell_bits:
            (offsets, fine_bits) = read_fine_positions(*take_column(payload), node.points)
            require(fine_bits == cell_bits, "fine positions are of other cells")
            positions = (positions << np.uint64(cell_bits)) + offsets
            sizes[0] += payload.at
        if group == fine_group and coarse_color:
            start = payload.at
            values["color"] = read_fine_colors(*take_column(payload), values["color"])
            sizes[1] += payload.at - start
        for i, attribute in enumerate(group_columns(manifest, group), start=int(group == 0)):
            count = texels if is_texel(attribute) else node.points
            start = payload.at
            (encoding, data) = take_column(payload) if length else (1, b"")
            sizes[i] += payload.at - start
            coarse_color |= length > 0 and encoding == 8 and any(data[4:7])
            require(encoding != 8 or manifest.get("fine", {}).get("color") and attribute["name"] == "color", "coarse values are no colour")
            column = read_values(encoding, data, TYPES[attribute["type"]], attribute["components"], count)
            values[attribute["name"]] = column
            if attribute["name"] == "texture_size":
                texels = int(np.prod(column.astype(np.uint64), axis=1).sum())
        payload.finish()

    codes = [morton_code(*position) for position in positions]
    require(codes == sorted(codes), "elements are not in Morton order")
    side_bits = manifest["lattice"]["side_bits"]
    require(node.level <= side_bits, "a node is smaller than a lattice unit")
    bits = side_bits - node.level
    check_bounds(node, positions, bits)
    check_cones(index, node, values)
    corner = np.array(node.cube, np.uint64) << np.uint64(bits)
    for attribute in manifest["attributes"]:
        if "constant" in attribute["storage"]:
            value = bytes.fromhex(attribute["storage"]["constant"]["value"])
            count = texels if is_texel(attribute) else node.points
            values[attribute["name"]] = np.tile(np.frombuffer(value, TYPES[attribute["type"]]), (count, 1))
    return positions + corner, values


def take_column(payload):
    encoding = payload.take(1)[0]
    return encoding, payload.take(payload.u32())


def group_columns(manifest, group):
    return [a for a in manifest["attributes"] if a["storage"].get("column", {}).get("group") == group]


def is_texel(attribute):
    return attribute.get("domain", "element") == "texel"


def check_bounds(node, positions, bits):
    for axis in range(3):
        lowest = node.bounds[axis] * 2**bits // 256
        highest = -(-(node.bounds[axis + 3] + 1) * 2**bits // 256) - 1
        inside = all(lowest <= int(q) <= highest for q in positions[:, axis])
        require(inside, "a point is outside of its node's bounds")


def check_cones(index, node, values):
    """The normals of a node lie in its own cone and in those of all nodes above."""
    normal = [a for a in index.manifest["attributes"] if a["name"] == "normal" and a["components"] == 3]
    stored = any("column" in a["storage"] and not is_texel(a) for a in normal)
    require(bool(node.normal_cone) == stored, "cones go with normals")
    if not stored:
        return
    index.cones[node.level, node.cube] = node.normal_cone
    normals = values["normal"].astype(np.float64)
    lengths = np.sqrt((normals**2).sum(axis=1, keepdims=True))
    directed = np.isfinite(lengths[:, 0]) & (lengths[:, 0] > 0)
    units = normals[directed] / lengths[directed]
    for level in range(node.level + 1):
        cone = index.cones[level, tuple(c >> (node.level - level) for c in node.cube)]
        if cone[2] == 255:
            continue
        require(directed.all(), "a normal without direction is in a cone of fewer than all directions")
        angles = np.arccos(np.clip(units @ cone_axis(cone), -1, 1))
        require((angles <= cone[2] * math.pi / 255).all(), "a normal is outside of a cone")


def cone_axis(cone):
    (u, v) = (cone[0] / 127.5 - 1, cone[1] / 127.5 - 1)
    z = 1 - abs(u) - abs(v)
    if z < 0:
        (u, v) = (math.copysign(1 - abs(v), u), math.copysign(1 - abs(u), v))
    axis = np.array([u, v, z])
    return axis / np.sqrt((axis**2).sum())


# --- all of it ---------------------------------------------------------------------------------------------


def world(manifest, positions):
    lattice = manifest["lattice"]
    steps = np.array(lattice["origin"], np.int64) + positions.astype(np.int64)
    return steps.astype(np.float64) * lattice["scale"] + np.array(lattice["offset"], np.float64)


def sum_of_crcs(columns):
    """The sum of the CRC-32 of every row of the columns, side by side."""
    count = len(columns[0])
    rows = np.hstack([np.ascontiguousarray(c).view(np.uint8).reshape(count, -1) for c in columns]) if count else []
    return sum(zlib.crc32(row.tobytes()) for row in rows)


def read_dataset(path, on_node):
    """Reads all nodes; calls `on_node(world coordinates, values by attribute)`. Gives a summary."""
    with open(path, "rb") as file:
        index = read_index(file)
        manifest = index.manifest
        element_names = [a["name"] for a in manifest["attributes"] if not is_texel(a)]
        texel_names = [a["name"] for a in manifest["attributes"] if is_texel(a)]
        (nodes, points, levels, checksum) = (0, 0, 0, 0)
        (low, high) = ([math.inf] * 3, [-math.inf] * 3)
        for node in read_tree(file, index):
            (positions, values) = read_node(file, index, node)
            coordinates = world(manifest, positions)
            nodes += 1
            points += node.points
            levels = max(levels, node.level + 1)
            checksum += sum_of_crcs([coordinates] + [values[name] for name in element_names])
            if texel_names and node.points:
                checksum += sum_of_crcs([values[name] for name in texel_names])
            if node.points:
                low = [min(a, b) for a, b in zip(low, coordinates.min(axis=0).tolist())]
                high = [max(a, b) for a, b in zip(high, coordinates.max(axis=0).tolist())]
            on_node(coordinates, {name: values[name] for name in element_names})
    for name, found in (("points", points), ("nodes", nodes), ("levels", levels)):
        require(manifest[name] == found, f"the manifest says {manifest[name]} {name}, there are {found}")
    told = [group["columns"] for group in manifest["groups"]]
    require(index.column_bytes == told, "columns take other numbers of bytes than the manifest says")
    bounds = world(manifest, np.array([manifest["bounds"]["min"], manifest["bounds"]["max"]], np.uint64)).tolist()
    require(not points or bounds == [low, high], "the manifest's bounds are not those of the points")
    return {
        "points": points,
        "nodes": nodes,
        "levels": levels,
        "min": low if points else None,
        "max": high if points else None,
        "attributes": element_names + texel_names,
        "content_id": index.content_id,
        "checksum": f"{checksum % 2**64:016x}",
    }


def csv_writer(out, write_header):
    """Something for `read_dataset` that writes every element as a line."""
    writer = csv.writer(out)

    def on_node(coordinates, values):
        if write_header:
            names = [f"{name}_{i}" if v.shape[1] > 1 else name for name, v in values.items() for i in range(v.shape[1])]
            writer.writerow(["x", "y", "z", *names])
            write_header.clear()
        columns = [coordinates, *values.values()]
        writer.writerows(zip(*(column[:, i].tolist() for column in columns for i in range(column.shape[1]))))

    return on_node


def main():
    parser = argparse.ArgumentParser(description="Reads a lodestream dataset.")
    parser.add_argument("dataset")
    parser.add_argument("--csv", metavar="OUT", help="write every element's position and attributes")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    options = parser.parse_args()
    if options.csv:
        with open(options.csv, "w", newline="", encoding="utf-8") as out:
            summary = read_dataset(options.dataset, csv_writer(out, [True]))
    else:
        summary = read_dataset(options.dataset, lambda *_: None)
    if options.json:
        print(json.dumps(summary))
    else:
        for name, value in summary.items():
            print(f"{name:12}{value}")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError, RuntimeError) as error:  # pco raises the last
        sys.exit(f"{sys.argv[1]}: {error}")
