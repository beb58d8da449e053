// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "terrain_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>
#ifdef EXAMPLES_HAVE_TIFF
#include <tiffio.h>
#endif

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

/// A TIFF put together tag by tag, of either byte order, with the types that a test wants.
class TiffMaker {
public:
  explicit TiffMaker(bool big = false) : big_(big) {}

  template <class Number>
  TiffMaker& tag(std::uint16_t tag, std::uint16_t type, const std::vector<Number>& values) {
    std::string bytes;
    for (const Number value : values) put(bytes, value, big_);
    tags_[tag] = {type, static_cast<std::uint32_t>(values.size()), bytes};
    return *this;
  }
  TiffMaker& number(std::uint16_t tag, std::uint16_t value) {
    return this->tag<std::uint16_t>(tag, 3, {value});
  }
  TiffMaker& text(std::uint16_t tag, const std::string& words) {
    tags_[tag] = {2, static_cast<std::uint32_t>(words.size()), words};
    return *this;
  }
  TiffMaker& without(std::uint16_t tag) {
    tags_.erase(tag);
    return *this;
  }
  /// What stands behind the tags; strips or tiles begin there.
  template <class Number>
  TiffMaker& data(const std::vector<Number>& values) {
    data_.clear();
    for (const Number value : values) put(data_, value, big_);
    return *this;
  }

  /// The file; the tags `offsets` and `counts` (273 and 279, or 324 and 325) are set to one block.
  [[nodiscard]] std::string file(std::uint16_t offsets = 273, std::uint16_t counts = 279) const {
    auto tags = tags_;
    std::size_t end =
        8 + 2 + 12 * (tags.size() + (tags.contains(offsets) ? 0 : 1) + (tags.contains(counts) ? 0 : 1)) + 4;
    for (const auto& [number, tag] : tags)
      if (tag.bytes.size() > 4) end += tag.bytes.size();
    const auto one = [&](std::size_t value) {
      std::string bytes;
      put(bytes, static_cast<std::uint32_t>(value), big_);
      return Tag{4, 1, bytes};
    };
    tags.emplace(offsets, one(end));
    tags.emplace(counts, one(data_.size()));
    std::string bytes = big_ ? "MM" : "II", behind;
    put<std::uint16_t>(bytes, 42, big_);
    put<std::uint32_t>(bytes, 8, big_);
    put(bytes, static_cast<std::uint16_t>(tags.size()), big_);
    const std::size_t after = 8 + 2 + 12 * tags.size() + 4;
    for (const auto& [number, tag] : tags) {
      put(bytes, number, big_);
      put(bytes, tag.type, big_);
      put(bytes, tag.count, big_);
      if (tag.bytes.size() <= 4) {
        bytes += tag.bytes + std::string(4 - tag.bytes.size(), '\0');
      } else {
        put(bytes, static_cast<std::uint32_t>(after + behind.size()), big_);
        behind += tag.bytes;
      }
    }
    put<std::uint32_t>(bytes, 0, big_);
    return bytes + behind + data_;
  }

private:
  struct Tag {
    std::uint16_t type;
    std::uint32_t count;
    std::string bytes;
  };
  bool big_;
  std::map<std::uint16_t, Tag> tags_;
  std::string data_;
};

/// Floats, 3 x 2 heights in one strip, spacing 10 x 20 m, no-data value -9999.
TiffMaker small_tiff(bool big = false) {
  TiffMaker tiff(big);
  tiff.number(256, 3).number(257, 2).number(258, 32).number(259, 1).number(262, 1).number(277, 1);
  tiff.number(278, 2)
      .number(339, 3)
      .tag<double>(33550, 12, {10, 20, 0})
      .text(42113, std::string("-9999\0", 6));
  return tiff.data<float>({1.5F, 2.5F, -9999.0F, 4.5F, 5.5F, 6.5F});
}

}  // namespace

TEST_SUITE("terrain_file") {
#ifdef EXAMPLES_HAVE_TIFF
  TEST_CASE("terrain_file: a GeoTIFF of either byte order, north up, no-data as void") {
    const Folder folder;
    for (const bool big : {false, true}) {
      CAPTURE(big);
      folder.put("a.tif", small_tiff(big).file());
      const cairn::FieldGrid grid = read_terrain(folder / "a.tif");
      REQUIRE(grid.columns() == 3);
      REQUIRE(grid.rows() == 2);
      CHECK(grid.frame().dx == 10.0);
      CHECK(grid.frame().dy == 20.0);
      CHECK(grid(0, 1) == 1.5);  // the first row of the file is the northern one
      CHECK(grid(1, 1) == 2.5);
      CHECK(std::isnan(grid(2, 1)));
      CHECK(grid(0, 0) == 4.5);
      CHECK(grid(2, 0) == 6.5);
    }
  }

  TEST_CASE("terrain_file: a GeoTIFF of any kind of number, in strips or tiles of either byte order") {
    const Folder folder;
    const auto check = [&](const TiffMaker& tiff, bool tiled, const std::vector<double>& heights) {
      folder.put("a.tif", tiled ? tiff.file(324, 325) : tiff.file());
      const cairn::FieldGrid grid = read_terrain(folder / "a.tif");
      REQUIRE(grid.columns() == 3);
      REQUIRE(grid.rows() == 2);
      for (int i = 0; i < 6; ++i) {
        const double found = grid(i % 3, 1 - i / 3), expected = heights[static_cast<std::size_t>(i)];
        CHECK((found == expected || (std::isnan(found) && std::isnan(expected))));
      }
    };
    const auto check_type = [&](auto first, std::uint16_t format) {
      using Number = decltype(first);
      const Number low = std::numeric_limits<Number>::lowest(), high = std::numeric_limits<Number>::max();
      const std::vector<Number> numbers{first, low, high, Number(3), Number(2), Number(1)};
      std::vector<double> heights(numbers.begin(), numbers.end());
      for (double& height : heights)  // what is no height of the Earth is a void
        if (height < -12000 || height > 1e30) height = cairn::void_value;
      for (const bool big : {false, true}) {
        CAPTURE(big);
        CAPTURE(format);
        TiffMaker tiff = small_tiff(big);
        tiff.number(258, 8 * sizeof(Number)).number(339, format).without(42113);
        check(tiff.data(numbers), false, heights);
        std::vector<Number> tile(256);  // 16 x 16, the rest of it beyond the image
        for (std::size_t i = 0; i < 6; ++i) tile[i / 3 * 16 + i % 3] = numbers[i];
        tiff.without(278).number(322, 16).number(323, 16);
        check(tiff.data(tile), true, heights);
      }
    };
    check_type(std::uint8_t{200}, 1);
    check_type(std::uint16_t{40000}, 1);
    check_type(std::uint32_t{4000000000}, 1);
    check_type(std::int8_t{-100}, 2);
    check_type(std::int16_t{-11000}, 2);
    check_type(std::int32_t{2000000000}, 2);
    check_type(-0.25F, 3);
    check_type(1.0 / 3.0, 3);
  }

  TEST_CASE("terrain_file: a compressed GeoTIFF, in strips and in tiles") {
    const Folder folder;
    constexpr std::uint32_t columns = 70, rows = 50;
    const auto height = [](std::uint32_t c, std::uint32_t r) {
      return static_cast<float>(std::sin(0.3 * c) * r);
    };
    for (const int compression :
         {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS})
      for (const bool tiled : {false, true}) {
        CAPTURE(compression);
        CAPTURE(tiled);
        TIFF* tiff = TIFFOpen((folder / "a.tif").c_str(), "w");
        REQUIRE(tiff != nullptr);
        TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, columns);
        TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, rows);
        TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 32);
        TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
        TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
        TIFFSetField(tiff, TIFFTAG_COMPRESSION, compression);
        if (compression == COMPRESSION_LZW || compression == COMPRESSION_ADOBE_DEFLATE)
          TIFFSetField(tiff, TIFFTAG_PREDICTOR, PREDICTOR_FLOATINGPOINT);
        const std::uint32_t block = 32;
        if (tiled) {
          TIFFSetField(tiff, TIFFTAG_TILEWIDTH, block);
          TIFFSetField(tiff, TIFFTAG_TILELENGTH, block);
          for (std::uint32_t top = 0; top < rows; top += block)
            for (std::uint32_t left = 0; left < columns; left += block) {
              std::vector<float> tile(block * block);
              for (std::uint32_t i = 0; i < block * block; ++i)
                tile[i] = height(left + i % block, top + i / block);
              REQUIRE(TIFFWriteTile(tiff, tile.data(), left, top, 0, 0) > 0);
            }
        } else {
          TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 7);
          for (std::uint32_t r = 0; r < rows; ++r) {
            std::vector<float> row(columns);
            for (std::uint32_t c = 0; c < columns; ++c) row[c] = height(c, r);
            REQUIRE(TIFFWriteScanline(tiff, row.data(), r, 0) == 1);
          }
        }
        TIFFClose(tiff);
        const cairn::FieldGrid grid = read_terrain(folder / "a.tif", 12.5);
        REQUIRE(grid.columns() == 70);
        REQUIRE(grid.rows() == 50);
        CHECK(grid.frame().dx == 12.5);  // the file says nothing of it
        int differing = 0;
        for (std::uint32_t r = 0; r < rows; ++r)
          for (std::uint32_t c = 0; c < columns; ++c)
            differing += grid(static_cast<int>(c), static_cast<int>(rows - 1 - r)) != height(c, r);
        CHECK(differing == 0);
      }
  }

  TEST_CASE("terrain_file: heights that are no numbers are voids, whatever the no-data value is") {
    const Folder folder;
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    for (const std::string value : {"-9999", "nan", " -9999 ", "-3.40282e+38", "inf", ""}) {
      CAPTURE(value);
      TiffMaker tiff = small_tiff();
      tiff.text(42113, value + std::string("\0", 1)).data<float>({nan, inf, -inf, 1, -3.40282e+38F, 3});
      if (value.empty()) tiff.without(42113);
      folder.put("a.tif", tiff.file());
      const cairn::FieldGrid grid = read_terrain(folder / "a.tif");
      for (int c = 0; c < 3; ++c) CHECK(std::isnan(grid(c, 1)));
      CHECK(grid(0, 0) == 1);
      CHECK(std::isnan(grid(1, 0)));
      CHECK(grid(2, 0) == 3);
    }
  }

  TEST_CASE("terrain_file: no-data values that the file does not name are voids, not cliffs") {
    const Folder folder;
    for (const float mark : {-9999.0F, -32767.0F, -32768.0F, -3.4028235e38F, 3.4028235e38F}) {
      CAPTURE(mark);
      folder.put("a.tif", small_tiff().without(42113).data<float>({mark, 2, 3, -10900, mark, 8848}).file());
      const cairn::FieldGrid grid = read_terrain(folder / "a.tif");
      CHECK(std::isnan(grid(0, 1)));
      CHECK(std::isnan(grid(1, 0)));
      CHECK(grid(0, 0) == -10900);  // the deepest sea and the highest mountain are heights
      CHECK(grid(2, 0) == 8848);
    }
    // As GDAL prints it, with fewer digits than the float has: still that float.
    folder.put("a.tif",
               small_tiff().text(42113, std::string("0.1\0", 4)).data<float>({0.1F, 2, 3, 4, 5, 6}).file());
    CHECK(std::isnan(read_terrain(folder / "a.tif")(0, 1)));
  }

  TEST_CASE("terrain_file: a GeoTIFF that claims what it cannot hold is refused before memory is taken") {
    const Folder folder;
    const auto refusal = [&](const TiffMaker& tiff) {
      folder.put("a.tif", tiff.file());
      return message_of([&] { static_cast<void>(read_terrain(folder / "a.tif")); });
    };
    const auto huge = [](std::uint16_t compression) {
      TiffMaker tiff;
      tiff.tag<std::uint32_t>(256, 4, {65536}).tag<std::uint32_t>(257, 4, {65536}).number(258, 8);
      return tiff.number(259, compression);
    };
    CHECK(huge(1).file().size() < 90);
    CHECK(refusal(huge(1)).find("expected 65536 x 65536 heights, found a file of 86 bytes") !=
          std::string::npos);
    CHECK(refusal(huge(5)).find("expected 65536 x 65536 heights") != std::string::npos);
    CHECK(refusal(huge(8)).find("expected 65536 x 65536 heights") != std::string::npos);
    const auto sized = [](std::uint32_t columns, std::uint32_t rows) {
      return small_tiff().tag<std::uint32_t>(256, 4, {columns}).tag<std::uint32_t>(257, 4, {rows});
    };
    for (const auto& [columns, rows] :
         {std::pair{1U, 2U}, {0U, 2U}, {65537U, 2U}, {4294967295U, 4294967295U}})
      CHECK(refusal(sized(columns, rows)).find("a.tif: expected") != std::string::npos);
    CHECK(refusal(sized(3, 3)).find("a.tif: expected") != std::string::npos);
  }

  TEST_CASE("terrain_file: tags of another type or beyond the file are refused, not cast") {
    const Folder folder;
    const auto refusal = [&](const TiffMaker& tiff) {
      folder.put("a.tif", tiff.file());
      return message_of([&] { static_cast<void>(read_terrain(folder / "a.tif")); });
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double offset : {1e300, -1e300, nan, -1.0, 1e9, 1e15}) {
      CAPTURE(offset);
      CHECK(refusal(small_tiff().tag<double>(273, 12, {offset})).find("a.tif: expected") !=
            std::string::npos);
    }
    for (const std::uint32_t offset : {4000000000U, 260U, 0xffffffffU})
      CHECK(refusal(small_tiff().tag<std::uint32_t>(273, 4, {offset})).find("a.tif: expected") !=
            std::string::npos);
    for (const auto tag : std::vector<std::uint16_t>{256, 257, 258, 277, 339}) {
      CAPTURE(tag);
      for (const double value : {1e300, nan, -3.0})
        CHECK(refusal(small_tiff().tag<double>(tag, 12, {value})).find("a.tif: expected") !=
              std::string::npos);
    }
    for (const double scale : {nan, -10.0, 0.0, 1e-5, 1e300, std::numeric_limits<double>::infinity()}) {
      CAPTURE(scale);
      CHECK(refusal(small_tiff().tag<double>(33550, 12, {scale, 20, 0})).find("a spacing of 0.01 to 1e6") !=
            std::string::npos);
      CHECK(refusal(small_tiff().tag<double>(33550, 12, {10, scale, 0})).find("a spacing of 0.01 to 1e6") !=
            std::string::npos);
    }
    CHECK(refusal(small_tiff().number(33550, 10)).find("tag 33550 of its own type") != std::string::npos);
    CHECK(refusal(small_tiff().tag<double>(42113, 12, {-9999.0})).find("tag 42113 of its own type") !=
          std::string::npos);
    CHECK(refusal(small_tiff().text(42113, std::string("many\0", 5))).find("found 'many'") !=
          std::string::npos);
    CHECK(refusal(small_tiff().tag<double>(33550, 12, {10})).find("a pixel scale") != std::string::npos);
    CHECK(refusal(small_tiff().without(33550).tag<double>(34264, 12, std::vector<double>(16, 1.0)))
              .find("a pixel scale") != std::string::npos);
  }

  TEST_CASE("terrain_file: degrees are metres by the latitude in the middle") {
    const Folder folder;
    const double second = 1.0 / 3600;
    const auto in_degrees = [&](const std::vector<double>& scale, const std::vector<double>& tie) {
      folder.put("a.tif", small_tiff()
                              .tag<std::uint16_t>(34735, 3, {1, 1, 0, 2, 1024, 0, 1, 2, 2054, 0, 1, 9102})
                              .tag<double>(33550, 12, scale)
                              .tag<double>(33922, 12, tie)
                              .file());
      return read_terrain(folder / "a.tif").frame();
    };
    // Along the ellipsoid of WGS 84 (6378137 m, 1 / 298.257) a second of latitude and of longitude are 30.715
    // and 30.922 m at the equator, 30.870 and 21.902 m at 45 degrees.
    const cairn::GridFrame equator = in_degrees({second, second, 0}, {0, 0, 0, 10, second, 0});
    CHECK(equator.dx == doctest::Approx(30.922).epsilon(0.006));
    CHECK(equator.dy == doctest::Approx(30.715).epsilon(0.006));
    // A degree a row: the middle of the two is 45 though the north is 46, by whichever corner is tied.
    const cairn::GridFrame north = in_degrees({second, 1, 0}, {0, 0, 0, 10, 46, 0});
    CHECK(north.dx == doctest::Approx(21.902).epsilon(0.006));
    CHECK(in_degrees({second, 1, 0}, {0, 2, 0, 10, 44, 0}).dx == doctest::Approx(north.dx).epsilon(1e-12));
    CHECK(in_degrees({second, 1, 0}, {0, 0, 0, 10, -44, 0}).dx == doctest::Approx(north.dx).epsilon(1e-12));
    for (const double latitude : {91.0, -89.0, std::numeric_limits<double>::quiet_NaN()})
      CHECK(message_of([&] {
              static_cast<void>(in_degrees({second, 1, 0}, {0, 0, 0, 10, latitude, 0}));
            }).find("a latitude between") != std::string::npos);
    CHECK(message_of([&] { static_cast<void>(in_degrees({second, 1, 0}, {0, 0, 0})); }).find("a tie point") !=
          std::string::npos);
  }

  TEST_CASE("terrain_file: feet, radians and a geocentric system are refused, and degrees without a place") {
    const Folder folder;
    const auto refusal = [&](std::vector<std::uint16_t> keys) {
      keys.insert(keys.begin(), {1, 1, 0, static_cast<std::uint16_t>(keys.size() / 4)});
      folder.put("a.tif", small_tiff().tag(34735, 3, keys).file());
      return message_of([&] { static_cast<void>(read_terrain(folder / "a.tif")); });
    };
    CHECK(refusal({1024, 0, 1, 1, 3072, 0, 1, 32611, 3076, 0, 1, 9001}).empty());
    CHECK(refusal({1024, 0, 1, 2}).find("a tie point") != std::string::npos);
    CHECK(refusal({1024, 0, 1, 3}).find("key 1024 = 3") != std::string::npos);
    CHECK(refusal({1024, 0, 1, 2, 2054, 0, 1, 9101}).find("key 2054 = 9101") != std::string::npos);
    CHECK(refusal({1024, 0, 1, 1, 3076, 0, 1, 9002}).find("key 3076 = 9002") != std::string::npos);
    CHECK(refusal({3076, 34736, 1, 0}).empty());  // stands elsewhere
    CHECK(refusal({1024}).empty());
    CHECK(refusal({}).empty());
  }

  TEST_CASE("terrain_file: every truncation of a GeoTIFF is refused by name, none crashes") {
    const Folder folder;
    const std::string whole = small_tiff().file();
    for (std::size_t length = 0; length < whole.size(); ++length) {
      CAPTURE(length);
      folder.put("cut.tif", whole.substr(0, length));
      CHECK(message_of([&] {
              static_cast<void>(read_terrain(folder / "cut.tif"));
            }).find("cut.tif: expected") != std::string::npos);
    }
  }

  TEST_CASE("terrain_file: no damaged byte of a GeoTIFF crashes") {
    const Folder folder;
    const std::string whole = small_tiff().file();
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
#endif

  TEST_CASE("terrain_file: formats that are not read are refused with the reason") {
    const Folder folder;
    const auto refusal = [&](const std::string& name, const std::string& bytes) {
      folder.put(name, bytes);
      return message_of([&] { static_cast<void>(read_terrain(folder / name)); });
    };
#ifdef EXAMPLES_HAVE_TIFF
    CHECK(refusal("a.tif", small_tiff().number(259, 5).file()).find("a.tif: expected heights at") !=
          std::string::npos);  // no LZW
    CHECK(refusal("b.tif", "\x89PNG....").find("a TIFF file") != std::string::npos);
    CHECK(refusal("e.tif", small_tiff().number(277, 3).file()).find("one band") != std::string::npos);
    CHECK(refusal("f.tif", small_tiff().number(258, 64).number(339, 1).file()).find("format 1 of 64 bits") !=
          std::string::npos);
#else
    CHECK(refusal("a.tif", "II").find("built without libtiff") != std::string::npos);
#endif
    CHECK(refusal("c.png", "x").find("expected a terrain file") != std::string::npos);
    CHECK(refusal("N10E010.hgt", "short").find("found 5 bytes") != std::string::npos);
    CHECK(refusal("d.pgm", "P6 1 1 255\nabc").find("expected a grey image") != std::string::npos);
    for (const char* none : {"none.tif", "none.hgt", "none.pgm"})
      CHECK(message_of([&] { static_cast<void>(read_terrain(folder / none)); }).find("no such file") !=
            std::string::npos);
  }

  TEST_CASE("terrain_file: SRTM tiles and grey images") {
    const Folder folder;
    std::string tile(std::size_t{2} * 1201 * 1201, '\0');
    tile[0] = '\x01';  // 256 + 2 in the north-western corner
    tile[1] = '\x02';
    tile[2] = '\x80';  // -32768: void
    tile[4] = '\x80';  // -32767: void
    tile[5] = '\x01';
    folder.put("N59E010.hgt", tile);
    const cairn::FieldGrid srtm = read_terrain(folder / "N59E010.hgt");
    CHECK(srtm.columns() == 1201);
    CHECK(srtm(0, 1200) == 258.0);
    CHECK(std::isnan(srtm(1, 1200)));
    CHECK(std::isnan(srtm(2, 1200)));
    CHECK(srtm.frame().dy == doctest::Approx(92.66).epsilon(0.001));
    CHECK(srtm.frame().dx == doctest::Approx(92.66 * std::cos(59.5 * 3.14159265 / 180)).epsilon(0.001));
    folder.put("a.pgm", std::string("P5 2 2 65535\n\0\1\0\2\1\0\0\4", 21));
    const cairn::FieldGrid grey = read_terrain(folder / "a.pgm", 5.0);
    CHECK(grey(0, 1) == 1.0);
    CHECK(grey(0, 0) == 256.0);
    CHECK(grey.frame().dx == 5.0);
    for (const char* name : {"N95E010.hgt", "Nan.hgt", "N-1E010.hgt"}) {  // no latitude: none taken
      folder.put(name, tile);
      const cairn::GridFrame frame = read_terrain(folder / name).frame();
      CHECK(frame.dx == frame.dy);
    }
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
