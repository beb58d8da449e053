// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Saving a multi-kd-tree and loading it again.
///
///   bytes 0-7    "cairnmk" and a zero
///   8-15         version of the format: 1           all numbers little-endian
///   16-23        ids given so far
///   24-31        FNV-1a checksum (64 bits) of bytes 8-23 and of all ids' states
///   32-          a byte an id: 0 never given, 1 in the index, 2 erased; then the points as a tree file
///
/// What is erased stays so: its number is not given again. Trees are not kept as they were, all points are
/// loaded into one; distances found are the same, of equally near points another may come first.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <istream>
#include <ostream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/detail/forest_queries.hpp>
#include <cairn/index/multi_kd_tree.hpp>
#include <cairn/index/tree_file.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

struct MultiTreeFileHeader {
  std::array<char, 8> magic{'c', 'a', 'i', 'r', 'n', 'm', 'k', '\0'};
  std::uint64_t version = 1;
  std::uint64_t ids = 0;
  std::uint64_t checksum = 0;

  [[nodiscard]] std::uint64_t checksum_with(const std::vector<char>& states) const noexcept {
    std::array<char, 16> sizes;
    std::memcpy(sizes.data(), &version, sizes.size());
    return fnv1a(states, fnv1a(sizes));
  }
};
static_assert(sizeof(MultiTreeFileHeader) == 32);

}  // namespace detail

/// Writes the points that are not erased, and which ids were given. Throws Error where the stream fails; open
/// it in binary mode.
template <class Scalar, std::size_t Dim, class M>
void save_tree(std::ostream& out, const MultiKdTree<Scalar, Dim, M>& index) {
  std::vector<char> states;
  for (const detail::PointState state : detail::ForestAccess::states(index))
    states.push_back(state == detail::PointState::live     ? '\1'
                     : state == detail::PointState::erased ? '\2'
                                                           : '\0');
  detail::MultiTreeFileHeader header;
  header.ids = states.size();
  header.checksum = header.checksum_with(states);
  out.write(reinterpret_cast<const char*>(&header), sizeof(header));
  out.write(states.data(), static_cast<std::streamsize>(states.size()));
  detail::write_points(out, index);
}

/// Reads a growing set of the same kind; how it goes on growing and its metric are not in the file. Throws
/// Error as load_tree() of a KdTree does.
template <class Index>
  requires detail::is_multi_kd_tree<Index>
[[nodiscard]] Index load_tree(std::istream& in, const std::string& name, MultiTreeShape shape = {},
                              typename Index::Measure metric = {}) {
  using Scalar = typename Index::Coordinate;
  const detail::MultiTreeFileHeader expected;
  detail::MultiTreeFileHeader header;
  if (!in.read(reinterpret_cast<char*>(&header), sizeof(header)) || header.magic != expected.magic)
    raise(name + ": not a cairn file of a growing tree");
  if (header.version != expected.version)
    raise(name + ": version " + std::to_string(header.version) + " of the growing tree's format, expected 1");
  if (header.ids > no_point) raise(name + ": " + std::to_string(header.ids) + " ids are too many");
  const auto states = detail::read_numbers<char>(in, header.ids, name);
  if (header.checksum_with(states) != header.checksum)
    raise(name + ": the checksum is wrong, the tree file is damaged");
  const auto points = detail::read_points<Scalar, Index::fixed_dimension>(in, name);
  std::size_t live = 0;
  for (std::size_t id = 0; id < states.size(); ++id) {
    const auto state = static_cast<unsigned char>(states[id]);  // a char may be signed, or not (ARM)
    if (state > 2)
      raise(name + ": id " + std::to_string(id) + " has the state " + std::to_string(state) +
            ", expected 0, 1 or 2");
    live += state == 1;
  }
  for (const PointId id : points.ids)
    if (id >= states.size() || states[id] != 1)
      raise(name + ": point " + std::to_string(id) + " is none of the ids in the index");
  if (live != points.ids.size())
    raise(name + ": " + std::to_string(points.ids.size()) + " points, expected " + std::to_string(live));
  Index index(shape, std::move(metric));
  if (!points.ids.empty()) index.insert(Rows<Scalar>(points.rows, points.dim), points.ids);
  std::vector<detail::PointState> restored(states.size(), detail::PointState::unknown);
  for (std::size_t id = 0; id < states.size(); ++id)
    if (states[id] != 0)
      restored[id] = states[id] == 1 ? detail::PointState::live : detail::PointState::erased;
  detail::ForestAccess::set_states(index, std::move(restored));
  return index;
}

}}  // namespace cairn::CAIRN_ABI
