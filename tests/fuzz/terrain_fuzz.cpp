// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
// Terrain files: the first byte says of which kind. A field that is read is finite or void and as large as
// its file can say.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include <cairn/core/check.hpp>
#include <cairn/field/grid.hpp>

#include "fuzz/scratch.hpp"
#include "terrain_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const cairn_fuzz::Scratch scratch;
  if (size == 0) return 0;
  constexpr std::array names{"a.tif", "b.pgm", "N47E011.hgt"};
  const auto file = scratch.put(names[data[0] % names.size()], cairn_fuzz::text_of(data + 1, size - 1));
  try {
    const cairn::FieldGrid grid = correlation_navigation::read_terrain(file);
    cairn_fuzz::expect(grid.columns() >= 1 && grid.rows() >= 1, "a field has nodes");
    cairn_fuzz::expect(grid.values().size() / 2048 <= size, "no more heights than the file can hold");
    cairn_fuzz::expect(std::isfinite(grid.frame().dx) && grid.frame().dx > 0 &&
                           std::isfinite(grid.frame().dy) && grid.frame().dy > 0,
                       "nodes are apart");
    bool any = false;
    for (const double height : grid.values()) {
      cairn_fuzz::expect(!std::isinf(height), "heights are finite or void");
      any = any || !std::isnan(height);
    }
    cairn_fuzz::expect(any, "a field that is voids only is refused");
  } catch (const cairn::Error&) {
    return cairn_fuzz::refused();
  }
  return 0;
}
