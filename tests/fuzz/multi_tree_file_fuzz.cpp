// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Files of growing trees: whatever the bytes, there is a tree that answers right and goes on growing, or an
// Error. Both checksums are made right first where the first byte says so.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/index/multi_tree_file.hpp>

#include "fuzz/scratch.hpp"
#include "support/made_up_file.hpp"

namespace {

using Index = cairn::MultiKdTree<float, 2>;

/// The checksums of the ids' states, and of the tree file behind them.
void sign_both(std::string& bytes) {
  if (bytes.size() < 32) return;
  std::uint64_t ids = 0;
  std::memcpy(&ids, bytes.data() + 16, sizeof ids);
  if (ids > bytes.size() - 32) return;
  cairn_test::sign(bytes, 8, 24, 32 + ids);
  cairn_test::sign(bytes, 32 + ids + 8, 32 + ids + 32, bytes.size());
}

std::string saved(const Index& index) {
  std::ostringstream out;
  cairn::save_tree(out, index);
  return out.str();
}

void check(const Index& index) {
  std::set<cairn::PointId> ids;
  double least = std::numeric_limits<double>::infinity();
  index.for_each([&](cairn::PointId id, std::span<const float> p) {
    cairn_fuzz::expect(ids.insert(id).second && index.contains(id), "ids are in the index, once each");
    least = std::min(least, std::hypot(double{p[0]} - 1, double{p[1]} - 2));
  });
  cairn_fuzz::expect(ids.size() == index.size(), "all points are there");
  const std::vector<float> query{1, 2};
  const auto hit = index.nearest(query);
  cairn_fuzz::expect(hit.has_value() == !ids.empty(), "there is a nearest point where there is one");
  if (hit && std::isfinite(hit->distance) && least > 1e-18)
    cairn_fuzz::expect(std::abs(double{hit->distance} - least) <= 1e-5 * least, "none is nearer");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if ((data[0] & 128U) != 0) sign_both(bytes);
  std::istringstream in(bytes);
  Index index;
  try {
    index = cairn::load_tree<Index>(in, "input", {.first_size = 4});
  } catch (const cairn::Error& error) {
    cairn_fuzz::expect(std::string_view(error.what()).starts_with("input: "), "an Error names the file");
    return cairn_fuzz::refused();
  }
  check(index);
  std::istringstream again(saved(index));
  const Index copy = cairn::load_tree<Index>(again, "written");
  cairn_fuzz::expect(copy.size() == index.size(), "a written index has the same points");
  const std::vector<float> more{1, 3, 4, 5, 1, 2};
  index.insert(cairn::Rows<float>(more, 2));
  check(index);
  cairn_fuzz::expect(index.size() == copy.size() + 3, "it grows");
  return 0;
}
