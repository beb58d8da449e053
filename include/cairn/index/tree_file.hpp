// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Saving a kd-tree and loading it again (one that grows: multi_tree_file.hpp).
///
///   bytes 0-7    "cairnkd" and a zero
///   8-11         version of the format: 1           all numbers little-endian
///   12-15        bytes a coordinate (1, 2, 4 or 8); 256 more for whole numbers from 0 on, 512 for others
///   16-23        dimension
///   24-31        points
///   32-39        FNV-1a checksum (64 bits) of bytes 8-31 and of all from 40 on
///   40-          ids (4 bytes each), then coordinates, point by point in leaf order
///
/// Loading checks the sum, every coordinate and every id and splits the points anew, so that no file, damaged
/// or made up, makes a damaged tree; that costs a build (about 0.1 us a point in three dimensions).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <istream>
#include <ostream>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/detail/point_ids.hpp>
#include <cairn/index/kd_tree.hpp>
#include <cairn/index/points.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

static_assert(std::endian::native == std::endian::little,
              "tree files are written as memory on little-endian machines");

struct TreeFileHeader {
  std::array<char, 8> magic{'c', 'a', 'i', 'r', 'n', 'k', 'd', '\0'};
  std::uint32_t version = 1;
  std::uint32_t coordinates = 0;  ///< kind_of_coordinate
  std::uint64_t dimension = 0;
  std::uint64_t points = 0;
  std::uint64_t checksum = 0;
};
static_assert(sizeof(TreeFileHeader) == 40);

/// What a file says of its coordinates.
template <class Scalar>
inline constexpr std::uint32_t kind_of_coordinate =
    static_cast<std::uint32_t>(sizeof(Scalar)) + (!std::is_integral_v<Scalar> ? 0U
                                                  : std::is_signed_v<Scalar>  ? 512U
                                                                              : 256U);
[[nodiscard]] inline std::string words_for_coordinate(std::uint32_t kind) {
  return std::to_string(kind % 256) + " bytes" +
         (kind / 256 == 1   ? " (whole numbers from 0 on)"
          : kind / 256 == 2 ? " (whole numbers)"
                            : "");
}

inline std::uint64_t fnv1a(std::span<const char> bytes, std::uint64_t hash = 0xcbf29ce484222325ULL) noexcept {
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  return hash;
}

template <class T>
std::span<const char> bytes_of(const std::vector<T>& numbers) noexcept {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}

/// Of everything but the magic and itself: also a header whose sizes were exchanged for others that fit is
/// noticed.
template <class Scalar>
std::uint64_t checksum_of(const TreeFileHeader& header, const std::vector<PointId>& ids,
                          const std::vector<Scalar>& rows) noexcept {
  std::array<char, 24> sizes;
  std::memcpy(sizes.data(), &header.version, sizes.size());
  return fnv1a(bytes_of(rows), fnv1a(bytes_of(ids), fnv1a(sizes)));
}

/// Reads `count` numbers a piece at a time, so that a header that promises too much costs no memory.
template <class T>
std::vector<T> read_numbers(std::istream& in, std::uint64_t count, const std::string& name) {
  constexpr std::uint64_t piece = 1 << 16;
  std::vector<T> numbers;
  while (numbers.size() < count) {
    const std::size_t old = numbers.size();
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(piece, count - old));
    numbers.resize(old + size);
    if (!in.read(reinterpret_cast<char*>(numbers.data() + old),
                 static_cast<std::streamsize>(size * sizeof(T))))
      raise(name + ": the tree file ends early, expected " + std::to_string(count) + " numbers");
  }
  return numbers;
}

/// Writes the points and ids of an index. Throws Error where the stream fails.
template <class Index, class Scalar = typename Index::Coordinate>
void write_points(std::ostream& out, const Index& index) {
  std::vector<PointId> ids;
  std::vector<Scalar> rows;
  ids.reserve(index.size());
  rows.reserve(index.size() * index.dimension());
  index.for_each([&](PointId id, std::span<const Scalar> row) {
    ids.push_back(id);
    rows.insert(rows.end(), row.begin(), row.end());
  });
  TreeFileHeader header;
  header.coordinates = kind_of_coordinate<Scalar>;
  header.dimension = index.dimension();
  header.points = index.size();
  header.checksum = checksum_of(header, ids, rows);
  out.write(reinterpret_cast<const char*>(&header), sizeof(header));
  for (const std::span<const char> part : {bytes_of(ids), bytes_of(rows)})
    out.write(part.data(), static_cast<std::streamsize>(part.size()));
  if (!out.flush()) raise("save_tree: the tree could not be written");
}

/// The points of a file: ids that a tree may have, and rows of `dim` checked numbers.
template <class Scalar>
struct PointsOfFile {
  std::size_t dim;
  std::vector<PointId> ids;
  std::vector<Scalar> rows;
};

/// Reads them. Throws Error, with `name` of the source, for what is no tree file or a damaged one.
template <class Scalar, std::size_t Dim>
[[nodiscard]] PointsOfFile<Scalar> read_points(std::istream& in, const std::string& name) {
  const TreeFileHeader expected;
  TreeFileHeader header;
  if (!in.read(reinterpret_cast<char*>(&header), sizeof(header)) || header.magic != expected.magic)
    raise(name + ": not a cairn tree file");
  if (header.version != expected.version)
    raise(name + ": version " + std::to_string(header.version) + " of the tree format, expected 1");
  if (header.coordinates != kind_of_coordinate<Scalar>)
    raise(name + ": coordinates of " + words_for_coordinate(header.coordinates) + ", expected " +
          words_for_coordinate(kind_of_coordinate<Scalar>));
  if ((Dim != dynamic_dim && header.dimension != Dim) || header.dimension > (1U << 16))
    raise(name + ": dimension " + std::to_string(header.dimension) + ", expected " +
          (Dim != dynamic_dim ? std::to_string(Dim) : "at most 65536"));
  if (header.points >= no_point) raise(name + ": " + std::to_string(header.points) + " points are too many");
  if (header.points > 0 && header.dimension == 0) raise(name + ": dimension 0, expected at least 1");
  PointsOfFile<Scalar> points{static_cast<std::size_t>(header.dimension), {}, {}};
  points.ids = read_numbers<PointId>(in, header.points, name);
  points.rows = read_numbers<Scalar>(in, header.points * header.dimension, name);
  if (checksum_of(header, points.ids, points.rows) != header.checksum)
    raise(name + ": the checksum is wrong, the tree file is damaged");
  if (const auto bad = bad_id(points.ids))
    raise(name + ": point " + std::to_string(*bad) + " has the id " + std::to_string(points.ids[*bad]) +
          ", expected one that no other point has and that is below 4294967295");
  if (!points.ids.empty()) check_rows(points.rows, points.dim, (name + ": point").c_str());
  return points;
}

}  // namespace detail

/// Writes the points and ids of a tree. Throws Error where the stream fails; open it in binary mode.
template <class Scalar, std::size_t Dim, class M>
void save_tree(std::ostream& out, const KdTree<Scalar, Dim, M>& tree) {
  detail::write_points(out, tree);
}

/// Reads a tree of the same kind, whose metric is not in the file. Throws Error, with `name` of the source,
/// for what is no tree file, a newer version, another kind of coordinates or dimension, a truncated or
/// damaged one, and for coordinates and ids that no tree can have.
template <class Tree, class Scalar = typename Tree::Coordinate>
  requires detail::is_kd_tree<Tree>
[[nodiscard]] Tree load_tree(std::istream& in, const std::string& name, typename Tree::Measure metric = {}) {
  auto points = detail::read_points<Scalar, Tree::fixed_dimension>(in, name);
  if (points.ids.empty()) return Tree();
  return Tree::from_rows(std::move(points.rows), points.dim, points.ids, std::move(metric));
}

}}  // namespace cairn::CAIRN_ABI
