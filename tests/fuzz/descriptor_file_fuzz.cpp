// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Files of descriptor indices: whatever the bytes, there is an index that answers right or an Error. The
// first byte says which of three point sets the file is beside, and whether the checksum is made right first,
// so that what stands behind it is met.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/descriptor_file.hpp>

#include "fuzz/scratch.hpp"
#include "support/made_up_file.hpp"

namespace {

using Points = cairn::Rows<float>;
using Index = cairn::DescriptorIndex<Points>;

void require(bool condition, const char* sentence) {
  if (condition) return;
  std::fprintf(stderr, "descriptor_file_fuzz: %s\n", sentence);
  std::abort();
}

std::string saved(const Index& index) {
  std::ostringstream out;
  cairn::save_tree(out, index);
  return out.str();
}

/// The points found are the index's, and the nearest is so by a loop.
void check(const Index& index, const Points& points) {
  std::set<cairn::PointId> ids;
  index.for_each([&](cairn::PointId id, std::span<const float>) {
    require(id < points.size() && ids.insert(id).second, "an id that is none, or twice");
  });
  require(ids.size() == index.size(), "points are missing");
  std::vector<float> query(points.dimension(), 0.75F);
  if (ids.empty() || index.dimension() != query.size()) return;
  const auto all = index.within(query, std::numeric_limits<float>::infinity());
  require(all.size() == ids.size(), "not all are within infinity");
  double least = std::numeric_limits<double>::infinity();
  for (const cairn::PointId id : ids) {
    double sum = 0;
    for (std::size_t a = 0; a < query.size(); ++a)
      sum += std::pow(double{points[id][a]} - double{query[a]}, 2);
    least = std::min(least, std::sqrt(sum));
  }
  const auto hit = index.nearest(query);
  require(hit && std::abs(double{hit->distance} - least) <= 1e-5 * (1 + least), "another is nearer");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if ((data[0] & 128U) != 0) cairn_test::sign(bytes, 48);
  std::vector<float> numbers(48);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto whole = static_cast<float>(i * 37 % 101);
    numbers[i] = (data[0] & 3U) == 0 ? whole : (data[0] & 3U) == 1 ? std::sqrt(whole) : 3.5F;
  }
  const Points points(numbers, (data[0] & 4U) != 0 ? 6 : 2);
  std::istringstream in(bytes);
  Index index(points);
  try {
    index = cairn::load_tree<Index>(in, "input", points, {.points_in_cell = 3});
  } catch (const cairn::Error& error) {
    require(std::string_view(error.what()).substr(0, 7) == "input: ", "an Error without the name");
    cairn_fuzz::refused();
  }
  check(index, points);
  for (cairn::PointId id = 0; id < points.size(); id += 2)
    if (!index.erase(id) && (index.empty() || index.dimension() == points.dimension())) index.insert(id);
  check(index, points);
  std::istringstream again(saved(index));
  const Index copy = cairn::load_tree<Index>(again, "written", points);
  require(copy.size() == index.size(), "a written index reads back with other points");
  check(copy, points);
  return 0;
}
