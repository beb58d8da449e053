// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "terrain_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/field/grid.hpp>
#include <cairn/io/file.hpp>

#include "support/data.hpp"
#include "support/folder.hpp"

using cairn_test::Folder;
using cairn_test::message_of;
using correlation_navigation::read_terrain;

namespace terrain_file_test {
namespace {

template <class Number>
void put(std::string& bytes, Number value, bool big) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);  // the tests run on little-endian machines
  for (std::size_t i = 0; i < sizeof value; ++i) bytes.push_back(raw[big ? sizeof value - 1 - i : i]);
}

/// A float TIFF of 3 x 2 heights in one strip, spacing 10 x 20 m, no-data value -9999.
std::string small_tiff(bool big, std::uint16_t compression = 1) {
  struct Tag {
    std::uint16_t tag, type;
    std::uint32_t count, value;
  };
  const std::uint32_t entries = 10, after = 8 + 2 + 12 * entries + 4, pixels = after + 24 + 8;
  const auto inline_short = [&](std::uint16_t v) { return big ? std::uint32_t{v} << 16U : std::uint32_t{v}; };
  const Tag tags[] = {{256, 3, 1, inline_short(3)},  {257, 3, 1, inline_short(2)},
                      {258, 3, 1, inline_short(32)}, {259, 3, 1, inline_short(compression)},
                      {273, 4, 1, pixels},           {277, 3, 1, inline_short(1)},
                      {278, 3, 1, inline_short(2)},  {339, 3, 1, inline_short(3)},
                      {33550, 12, 3, after},         {42113, 2, 6, after + 24}};
  std::string bytes = big ? "MM" : "II";
  put<std::uint16_t>(bytes, 42, big);
  put<std::uint32_t>(bytes, 8, big);
  put<std::uint16_t>(bytes, entries, big);
  for (const Tag& tag : tags) {
    put(bytes, tag.tag, big);
    put(bytes, tag.type, big);
    put(bytes, tag.count, big);
    put(bytes, tag.value, big);
  }
  put<std::uint32_t>(bytes, 0, big);
  for (const double scale : {10.0, 20.0, 0.0}) put(bytes, scale, big);
  bytes += std::string("-9999\0\0\0", 8);
  for (const float height : {1.5F, 2.5F, -9999.0F, 4.5F, 5.5F, 6.5F}) put(bytes, height, big);
  return bytes;
}

}  // namespace

TEST_SUITE("terrain_file") {
  TEST_CASE("terrain_file: a GeoTIFF of either byte order, north up, no-data as void") {
    const Folder folder;
    for (const bool big : {false, true}) {
      CAPTURE(big);
      folder.put("a.tif", small_tiff(big));
      const cairn::FieldGrid grid = read_terrain(folder / "a.tif");
      REQUIRE(grid.columns() == 3);
      REQUIRE(grid.rows() == 2);
      CHECK(grid.frame().dx == 10.0);
      CHECK(grid.frame().dy == 20.0);
      CHECK(grid(0, 1) == 1.5);  // the first row of the file is the northern one
      CHECK(std::isnan(grid(2, 1)));
      CHECK(grid(2, 0) == 6.5);
    }
  }

  TEST_CASE("terrain_file: every truncation of a GeoTIFF is refused by name, none crashes") {
    const Folder folder;
    const std::string whole = small_tiff(false);
    for (std::size_t length = 0; length < whole.size(); ++length) {
      folder.put("cut.tif", whole.substr(0, length));
      CHECK(message_of([&] {
              static_cast<void>(read_terrain(folder / "cut.tif"));
            }).find("cut.tif: expected") != std::string::npos);
    }
  }

  TEST_CASE("terrain_file: no damaged byte of a GeoTIFF crashes") {
    const Folder folder;
    const std::string whole = small_tiff(false);
    int refused = 0;
    for (std::size_t place = 0; place < whole.size(); ++place)
      for (const char value : {'\0', '\x7f', '\xff'}) {
        std::string damaged = whole;
        damaged[place] = value;
        folder.put("bad.tif", damaged);
        refused += message_of([&] { static_cast<void>(read_terrain(folder / "bad.tif")); }).empty() ? 0 : 1;
      }
    CHECK(refused > 50);
  }

  TEST_CASE("terrain_file: formats that are not read are refused with the reason") {
    const Folder folder;
    const auto refusal = [&](const std::string& name, const std::string& bytes) {
      folder.put(name, bytes);
      return message_of([&] { static_cast<void>(read_terrain(folder / name)); });
    };
    CHECK(refusal("a.tif", small_tiff(false, 5)).find("uncompressed TIFF") != std::string::npos);
    CHECK(refusal("b.tif", "\x89PNG....").find("a TIFF file") != std::string::npos);
    CHECK(refusal("c.png", "x").find("expected a terrain file") != std::string::npos);
    CHECK(refusal("N10E010.hgt", "short").find("found 5 bytes") != std::string::npos);
    CHECK(refusal("d.pgm", "P6 1 1 255\nabc").find("expected a grey image") != std::string::npos);
    CHECK(message_of([&] { static_cast<void>(read_terrain(folder / "none.tif")); }).find("no such file") !=
          std::string::npos);
  }

  TEST_CASE("terrain_file: SRTM tiles and grey images") {
    const Folder folder;
    std::string tile(std::size_t{2} * 1201 * 1201, '\0');
    tile[0] = '\x01';  // 256 + 2 in the north-western corner
    tile[1] = '\x02';
    tile[2] = '\x80';  // -32768: void
    folder.put("N59E010.hgt", tile);
    const cairn::FieldGrid srtm = read_terrain(folder / "N59E010.hgt");
    CHECK(srtm.columns() == 1201);
    CHECK(srtm(0, 1200) == 258.0);
    CHECK(std::isnan(srtm(1, 1200)));
    CHECK(srtm.frame().dy == doctest::Approx(92.66).epsilon(0.001));
    CHECK(srtm.frame().dx == doctest::Approx(92.66 * std::cos(59.5 * 3.14159265 / 180)).epsilon(0.001));
    folder.put("a.pgm", std::string("P5 2 2 65535\n\0\1\0\2\1\0\0\4", 21));
    const cairn::FieldGrid grey = read_terrain(folder / "a.pgm", 5.0);
    CHECK(grey(0, 1) == 1.0);
    CHECK(grey(0, 0) == 256.0);
    CHECK(grey.frame().dx == 5.0);
    std::string voids(std::size_t{2} * 1201 * 1201, '\0');
    for (std::size_t i = 0; i < voids.size(); i += 2) voids[i] = '\x80';
    folder.put("S01E010.hgt", voids);
    CHECK(message_of([&] { static_cast<void>(read_terrain(folder / "S01E010.hgt")); }).find("voids only") !=
          std::string::npos);
  }

  TEST_CASE("terrain_file: Big Tujunga") {
    const auto data = cairn_test::real_data("terrain");
    if (!data) return;
    const cairn::FieldGrid grid = read_terrain(*data / "srtm_bigtujunga30m_utm11.tif");
    CHECK(grid.columns() == 1197);
    CHECK(grid.rows() == 643);
    CHECK(grid.frame().dx == 30.0);
    double lowest = 1e9, highest = -1e9;
    for (const double height : grid.values())
      if (!std::isnan(height)) {
        lowest = std::min(lowest, height);
        highest = std::max(highest, height);
      }
    CHECK(lowest == 315.0);
    CHECK(highest == 2295.0);
  }
}

}  // namespace terrain_file_test
