// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Saving the cells of a descriptor index and loading them again, beside the caller's points.
///
///   bytes 0-7    "cairndi" and a zero
///   8-11         version of the format: 1           all numbers little-endian
///   12-15        what a byte's step is worth, a float
///   16-23        dimension
///   24-31        points
///   32-39        cells
///   40-47        FNV-1a (64 bits) of the bytes of all points, cell by cell
///   48-55        FNV-1a of bytes 8-47 and of all from 56 on
///   56-          lowest coordinate of each axis (floats), points of each cell (4 bytes each), their ids (4
///   bytes
///                each), cell by cell, means of the cells (a byte a coordinate)
///
/// ```cpp
/// cairn::save_tree(out, index);
/// auto again = cairn::load_tree<decltype(index)>(in, "file.index", descriptors);
/// ```
///
/// The points are not in the file, nor are their codes. Loading turns them to bytes anew, O(n), learns codes
/// where they pay (an index that grew may find a little else under a budget then) and measures every cell, so
/// that no file, damaged or made up, makes an index whose answers are wrong; a file of other points is
/// refused.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <istream>
#include <numeric>
#include <ostream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/detail/point_ids.hpp>
#include <cairn/index/points.hpp>
#include <cairn/index/tree_file.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

struct DescriptorFileHeader {
  std::array<char, 8> magic{'c', 'a', 'i', 'r', 'n', 'd', 'i', '\0'};
  std::uint32_t version = 1;
  float unit = 1;
  std::uint64_t dimension = 0;
  std::uint64_t points = 0;
  std::uint64_t cells = 0;
  std::uint64_t codes = 0;
  std::uint64_t checksum = 0;
};
static_assert(sizeof(DescriptorFileHeader) == 56);

struct DescriptorFile {
  DescriptorFileHeader header;
  std::vector<float> low;
  std::vector<std::uint32_t> sizes;
  std::vector<PointId> ids;
  std::vector<std::uint8_t> means;

  [[nodiscard]] std::uint64_t checksum() const noexcept {
    std::array<char, 40> numbers;
    std::memcpy(numbers.data(), &header.version, numbers.size());
    return fnv1a(bytes_of(means),
                 fnv1a(bytes_of(ids), fnv1a(bytes_of(sizes), fnv1a(bytes_of(low), fnv1a(numbers)))));
  }
};

/// Reads all but the points, and checks what can be checked without them.
[[nodiscard]] inline DescriptorFile read_descriptor_file(std::istream& in, const std::string& name) {
  const DescriptorFileHeader expected;
  DescriptorFile file;
  DescriptorFileHeader& header = file.header;
  if (!in.read(reinterpret_cast<char*>(&header), sizeof(header)) || header.magic != expected.magic)
    raise(name + ": not a cairn file of a descriptor index");
  if (header.version != expected.version)
    raise(name + ": version " + std::to_string(header.version) +
          " of the descriptor index's format, expected 1");
  if (header.dimension > most_byte_axes)
    raise(name + ": dimension " + std::to_string(header.dimension) + ", expected at most 16384");
  if (header.points >= no_point) raise(name + ": " + std::to_string(header.points) + " points are too many");
  if (header.cells > header.points || (header.points > 0 && (header.cells == 0 || header.dimension == 0)))
    raise(name + ": " + std::to_string(header.points) + " points of dimension " +
          std::to_string(header.dimension) + " in " + std::to_string(header.cells) + " cells cannot be");
  file.low = read_numbers<float>(in, header.dimension, name);
  file.sizes = read_numbers<std::uint32_t>(in, header.cells, name);
  file.ids = read_numbers<PointId>(in, header.points, name);
  file.means = read_numbers<std::uint8_t>(in, header.cells * header.dimension, name);
  if (file.checksum() != header.checksum)
    raise(name + ": the checksum is wrong, the file of the descriptor index is damaged");
  if (!(header.unit > 0) || !std::isfinite(header.unit))
    raise(name + ": a byte's step is worth " + std::to_string(header.unit) + ", expected a positive number");
  for (const float low : file.low)
    if (!std::isfinite(low)) raise(name + ": a lowest coordinate is not finite");
  std::uint64_t sum = 0;
  for (const std::uint32_t size : file.sizes) sum += size;
  if (sum != header.points || std::find(file.sizes.begin(), file.sizes.end(), 0U) != file.sizes.end())
    raise(name + ": cells of " + std::to_string(sum) + " points, none of them empty, expected " +
          std::to_string(header.points));
  if (const auto bad = bad_id(file.ids))
    raise(name + ": point " + std::to_string(*bad) + " has the id " + std::to_string(file.ids[*bad]) +
          ", expected one that no other point has and that is below 4294967295");
  return file;
}

/// Between an index and what a file holds of it.
struct DescriptorAccess {
  template <class Points>
  [[nodiscard]] static DescriptorFile parts_of(const DescriptorIndex<Points>& index) {
    DescriptorFile file;
    std::vector<std::uint8_t> code(index.dimension());
    file.low = index.scale_.low();
    for (std::size_t c = 0; c < index.cells(); ++c) {
      const auto members = index.cells_.members_of(c);
      file.sizes.push_back(static_cast<std::uint32_t>(members.size()));
      file.ids.insert(file.ids.end(), members.begin(), members.end());
      index.cells_.means().get(c, code.data());
      file.means.insert(file.means.end(), code.begin(), code.end());
    }
    std::uint64_t codes = fnv1a({});
    for (std::size_t c = 0; c < index.cells(); ++c)
      for (std::size_t i = 0; i < file.sizes[c]; ++i) {
        index.cells_.get(c, i, code.data());
        codes = fnv1a(bytes_of(code), codes);
      }
    file.header = {.unit = index.scale_.unit(),
                   .dimension = index.dimension(),
                   .points = index.size(),
                   .cells = index.cells(),
                   .codes = codes};
    file.header.checksum = file.checksum();
    return file;
  }

  template <class Points>
  [[nodiscard]] static DescriptorIndex<Points> index_of(DescriptorFile file, const std::string& name,
                                                        const Points& points,
                                                        const DescriptorIndexOptions& options) {
    DescriptorIndex<Points> index(&points, options);
    if (file.ids.empty()) return index;
    const std::size_t dim = file.low.size();
    index.scale_ = ByteScale(std::move(file.low), file.header.unit);
    index.size_ = file.ids.size();
    std::vector<float> row(dim);
    std::vector<std::uint8_t> codes(room_for(index.size_, dim, "DescriptorIndex: point"));
    for (std::size_t i = 0; i < index.size_; ++i) {
      const PointId id = file.ids[i];
      if (id >= static_cast<std::size_t>(points.size()))
        raise(name + ": point " + std::to_string(id) + " is none of a set of " +
              std::to_string(points.size()));
      copy_point<float>(points[id], dim, row.data(), {(name + ": point").c_str(), id});
      const auto missed = index.scale_.encode(row.data(), &codes[i * dim]);
      index.error_ = std::max(index.error_, missed.rounding);
      index.inside_ = index.inside_ && missed.outside_squared == 0;
    }
    if (fnv1a(bytes_of(codes)) != file.header.codes) raise(name + ": the points are not those of the file");
    KMeans cells;
    cells.means = std::move(file.means);
    cells.order.resize(index.size_);
    std::iota(cells.order.begin(), cells.order.end(), 0U);
    cells.first.assign(1, 0);
    for (const std::uint32_t size : file.sizes) cells.first.push_back(cells.first.back() + size);
    index.cells_ = ByteCells(dim, codes, file.ids, cells, index.codes_pay(index.size_), options.threads);
    return index;
  }
};

template <class T>
inline constexpr bool is_descriptor_index = false;
template <class Points>
inline constexpr bool is_descriptor_index<DescriptorIndex<Points>> = true;

}  // namespace detail

/// Writes the cells and ids of an index. Throws Error where the stream fails; open it in binary mode.
template <PointSet Points>
void save_tree(std::ostream& out, const DescriptorIndex<Points>& index) {
  const detail::DescriptorFile file = detail::DescriptorAccess::parts_of(index);
  out.write(reinterpret_cast<const char*>(&file.header), sizeof(file.header));
  for (const std::span<const char> part : {detail::bytes_of(file.low), detail::bytes_of(file.sizes),
                                           detail::bytes_of(file.ids), detail::bytes_of(file.means)})
    out.write(part.data(), static_cast<std::streamsize>(part.size()));
  if (!out.flush()) raise("save_tree: the descriptor index could not be written");
}

/// Reads an index of points that are those of the saved one at all of its ids; there may be others. How it
/// goes on growing is in `options`, not in the file. Throws Error, with `name` of the source, for what is no
/// such file, a newer version, a truncated or damaged one, and for other points.
template <class Index, PointSet Points>
  requires detail::is_descriptor_index<Index> && std::same_as<Index, DescriptorIndex<Points>>
[[nodiscard]] Index load_tree(std::istream& in, const std::string& name, const Points& points,
                              const DescriptorIndexOptions& options = {}) {
  return detail::DescriptorAccess::index_of(detail::read_descriptor_file(in, name), name, points, options);
}

}}  // namespace cairn::CAIRN_ABI
