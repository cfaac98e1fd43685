#include "kernels/kernel_race.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <vector>

#include "build/builder.h"
#include "core/random.h"
#include "kernels/trace.h"

namespace wive {
namespace {

// A tree of a megabyte: larger than the first-level cache, built in milliseconds.
constexpr std::uint32_t sheets = 4, cells = 50;  // two triangles per cell
constexpr std::size_t ray_count = 1024;
constexpr int turns = 3, passes = 3;
// Times closer than this count as equal, and the holder is kept, so that every run of a program uses the same form.
constexpr double clear_lead = 0.98;

// Rough horizontal sheets in the unit cube, and rays from random points in all directions.
class Course {
public:
    Course() {
        const auto point = [](std::uint32_t sheet, std::uint32_t row, std::uint32_t column) {
            return (sheet * (cells + 1) + row) * (cells + 1) + column;
        };
        for (std::uint32_t i = 0; i < sheets * (cells + 1) * (cells + 1); ++i) {
            const std::uint32_t sheet = i / ((cells + 1) * (cells + 1)), row = i / (cells + 1) % (cells + 1);
            const auto random = pcg4d(i, 0, 0, 0);
            vertices_.push_back((static_cast<float>(i % (cells + 1)) + 0.5f * to_unit(random[0])) / cells);
            vertices_.push_back((static_cast<float>(row) + 0.5f * to_unit(random[1])) / cells);
            vertices_.push_back((static_cast<float>(sheet) + 0.3f * to_unit(random[2])) / sheets);
        }
        for (std::uint32_t sheet = 0; sheet < sheets; ++sheet)
            for (std::uint32_t row = 0; row < cells; ++row)
                for (std::uint32_t column = 0; column < cells; ++column) {
                    const std::uint32_t corners[2][2] = {
                        {point(sheet, row, column), point(sheet, row, column + 1)},
                        {point(sheet, row + 1, column), point(sheet, row + 1, column + 1)}};
                    for (const std::uint32_t corner : {corners[0][0], corners[0][1], corners[1][1],  //
                                                       corners[0][0], corners[1][1], corners[1][0]})
                        faces_.push_back(static_cast<std::int32_t>(corner));
                }
        for (std::uint32_t i = 0; i < ray_count; ++i) {
            const auto from = pcg4d(i, 1, 0, 0), to = pcg4d(i, 2, 0, 0);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                origins_.push_back(to_unit(from[axis]));
                directions_.push_back(2 * to_unit(to[axis]) - 1);
            }
        }
    }

    Mesh<float> mesh() const { return {vertices_.data(), vertices_.size() / 3, faces_.data(), faces_.size() / 3}; }
    RayBatch<float> rays() const { return {origins_.data(), directions_.data(), &tmin_, &tmax_, 0, 0}; }

private:
    std::vector<float> vertices_, origins_, directions_;
    std::vector<std::int32_t> faces_;
    float tmin_ = 0, tmax_ = std::numeric_limits<float>::infinity();
};

}  // namespace

bool is_faster(const KernelTable<float>& challenger, const KernelTable<float>& holder) {
    constexpr KernelChoice choice = {QueryKind::closest, Accuracy::watertight, NodeForm::float32, false};
    const Course course;
    const Bvh bvh(course.mesh(), {.accuracy = choice.accuracy, .nodes = choice.nodes, .threads = 1});
    std::vector<float> t(ray_count);
    std::vector<std::int32_t> prim(ray_count);
    HitBatch<float> hits;
    hits.t = t.data();
    hits.prim = prim.data();

    const std::array tables = {&challenger, &holder};
    // One ray at a time, and as many in flight as batches have: users do both with one table, so the product of the two
    // times decides.
    const std::array in_flight = {1u, 0u};
    double best[2][2];
    for (auto& of_table : best)
        std::fill(std::begin(of_table), std::end(of_table), std::numeric_limits<double>::infinity());
    for (int turn = 0; turn < turns; ++turn)
        for (std::size_t table = 0; table < 2; ++table) {
            const TraceBatch<float> kernel = tables[table]->find(choice);
            for (std::size_t way = 0; way < 2; ++way)
                // Several passes per turn: some processors lower their clock for 512-bit arithmetic and need up to a
                // millisecond to raise it after the other table's turn.
                for (int pass = 0; pass < passes; ++pass) {
                    const auto begin = std::chrono::steady_clock::now();
                    trace(*tables[table], kernel, bvh.view(), course.rays(), hits, ray_count, 1, in_flight[way]);
                    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
                    best[table][way] = std::min(best[table][way], seconds.count());
                }
        }
    return best[0][0] * best[0][1] < clear_lead * clear_lead * best[1][0] * best[1][1];
}

}  // namespace wive
