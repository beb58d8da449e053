// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <doctest/doctest.h>

#include <cairn/simd/registers.hpp>

namespace registers_test {
namespace {

using cairn::detail::lane_count;
using cairn::detail::Lanes;
using cairn::detail::RegisterFor;

struct Dual {
  double value, slope;
};

static_assert(sizeof(Lanes<float, 4>) == 16 && sizeof(Lanes<std::uint8_t, 32>) == 32);
static_assert(sizeof(Lanes<std::int64_t, 16>) == 128);
// Of what has no register there is one, on every target.
static_assert(std::is_same_v<RegisterFor<Dual, 8>, Dual> && lane_count<Dual, 8> == 1);
static_assert(std::is_same_v<RegisterFor<long double, 8>, long double> && lane_count<long double, 8> == 1);

/// Holds as many numbers as it says; no wider than needed from the least register on, no narrower than the
/// target's where the numbers fill one.
template <class T, int N>
void check_register() {
  constexpr std::size_t lanes = lane_count<T, N>, bytes = lanes * sizeof(T);
  CHECK(sizeof(RegisterFor<T, N>) == bytes);
  CHECK((bytes == 16 || bytes < 2 * N * sizeof(T)));
#if defined(__AVX512F__)
  CHECK((bytes == 64 || bytes >= N * sizeof(T)));
#elif defined(__AVX__)
  CHECK((bytes == 32 || (bytes == 16 && N * sizeof(T) <= 16)));
#else
  CHECK(bytes == 16);
#endif
}

struct Backwards {
  constexpr int operator()(int l) const { return 7 - l; }
};

}  // namespace

TEST_SUITE("registers") {
  TEST_CASE("lane_count: the widest register that N numbers can use") {
    check_register<double, 1>();
    check_register<double, 2>();
    check_register<double, 3>();
    check_register<double, 5>();
    check_register<double, 64>();
    check_register<float, 1>();
    check_register<float, 5>();
    check_register<float, 9>();
    check_register<float, 64>();
    check_register<std::uint64_t, 8>();
  }

  TEST_CASE("shuffle, shuffled: lanes by their numbers, of two registers written one after the other") {
    const Lanes<float, 4> a{0, 1, 2, 3}, b{4, 5, 6, 7};
    Lanes<float, 4> same;
    cairn::detail::shuffle<6, 0, 3, 5>(a, b, same);
    CHECK((same[0] == 6 && same[1] == 0 && same[2] == 3 && same[3] == 5));
    Lanes<float, 2> fewer;
    cairn::detail::shuffle<7, 2>(a, b, fewer);
    CHECK((fewer[0] == 7 && fewer[1] == 2));
    const auto turned = cairn::detail::shuffled<float, 4, Backwards>(a, b);
    for (int l = 0; l < 4; ++l) CHECK(turned[l] == static_cast<float>(7 - l));
    const Lanes<std::int64_t, 2> c{0, 1}, d{2, 3};
    Lanes<std::int64_t, 2> whole;
    cairn::detail::shuffle<3, 1>(c, d, whole);
    CHECK((whole[0] == 3 && whole[1] == 1));
    const auto pair = cairn::detail::shuffled<5, 0>(a, b);
    static_assert(std::is_same_v<decltype(pair), const Lanes<float, 2>>);
    CHECK((pair[0] == 5 && pair[1] == 0));
  }

  TEST_CASE("load, store, sum: any address, and neighbours are added first") {
    const float from[6] = {0, 1e8F, 1, -1e8F, 3, 0};
    float to[6] = {7, 7, 7, 7, 7, 7};
    const auto lanes = cairn::detail::load<Lanes<float, 4>>(from + 1);
    cairn::detail::store(lanes, to + 1);
    CHECK((to[0] == 7 && to[1] == 1e8F && to[2] == 1 && to[3] == -1e8F && to[4] == 3 && to[5] == 7));
    CHECK(cairn::detail::sum(lanes) == 0);  // 1e8 swallows 1, -1e8 swallows 3
    CHECK(cairn::detail::sum(Lanes<std::int64_t, 2>{5, -7}) == -2);
  }
}

}  // namespace registers_test
