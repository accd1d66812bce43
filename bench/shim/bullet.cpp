// Bullet's dynamic AABB tree in its usual form: one proxy per sphere, kept between steps, and the pair cache of the
// broad phase. Spheres are rows of four floats: x, y, z, radius. No exception leaves this file.
#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <vector>

namespace {

struct Sphere {
    float x, y, z, radius;
};

struct Pair {
    std::uint32_t i, j;
};

struct World {
    std::unique_ptr<btDbvtBroadphase> broadphase{new btDbvtBroadphase()};
    std::vector<btBroadphaseProxy*> proxies;
    std::vector<Pair> pairs;
    float margin = 0.05f;

    ~World() {
        // Frees what createProxy allocated. Removing a million proxies from the tree one by one would only cost time.
        for (btBroadphaseProxy* proxy : proxies) {
            btAlignedFree(proxy);
        }
    }
};

// A few ulp larger than the sphere, because rounding might otherwise lose a tangent pair.
void box(const Sphere& s, btVector3& low, btVector3& high) {
    const float far = std::fmax(std::fabs(s.x), std::fmax(std::fabs(s.y), std::fabs(s.z))) + s.radius;
    const float half = s.radius + far * 1.1920929e-7f;
    low = btVector3(s.x - half, s.y - half, s.z - half);
    high = btVector3(s.x + half, s.y + half, s.z + half);
}

// The exact test of all contenders: in double near tangency.
bool touch(const Sphere& a, const Sphere& b) {
    const float reach = a.radius + b.radius;
    const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
    const float gap = dx * dx + dy * dy + dz * dz - reach * reach;
    if (std::fabs(gap) > 1e-6f * reach * reach) {
        return gap < 0.0f;
    }
    const double ex = double(a.x) - double(b.x), ey = double(a.y) - double(b.y), ez = double(a.z) - double(b.z);
    const double sum = double(a.radius) + double(b.radius);
    return ex * ex + ey * ey + ez * ez <= sum * sum;
}

std::uint32_t index_of(const btBroadphaseProxy* proxy) {
    return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(proxy->m_clientObject));
}

void step(World& world, const Sphere* spheres, std::uint32_t n) {
    gDbvtMargin = world.margin;  // Bullet has one for the whole process.
    btVector3 low, high;
    if (world.proxies.empty()) {
        world.proxies.reserve(n);
        for (std::uint32_t k = 0; k < n; ++k) {
            box(spheres[k], low, high);
            void* client = reinterpret_cast<void*>(static_cast<std::uintptr_t>(k));
            world.proxies.push_back(world.broadphase->createProxy(low, high, 0, client, 1, 1, nullptr));
        }
    } else {
        for (std::uint32_t k = 0; k < n; ++k) {
            box(spheres[k], low, high);
            world.broadphase->setAabb(world.proxies[k], low, high, nullptr);
        }
    }
    world.broadphase->calculateOverlappingPairs(nullptr);
    world.pairs.clear();
    const btBroadphasePairArray& cached = world.broadphase->getOverlappingPairCache()->getOverlappingPairArray();
    for (int k = 0; k < cached.size(); ++k) {
        const std::uint32_t a = index_of(cached[k].m_pProxy0), b = index_of(cached[k].m_pProxy1);
        if (touch(spheres[a], spheres[b])) {
            world.pairs.push_back(a < b ? Pair{a, b} : Pair{b, a});
        }
    }
}

}  // namespace

extern "C" {

// Returns null if memory is exhausted. A negative margin selects Bullet's default.
World* lazygrid_bullet_new(float margin, int deferred) {
    try {
        std::unique_ptr<World> world(new World());
        if (margin >= 0.0f) {
            world->margin = margin;
        }
        world->broadphase->m_deferedcollide = deferred != 0;
        return world.release();
    } catch (...) {
        return nullptr;
    }
}

int lazygrid_bullet_version() {
    return btGetVersion();
}

void lazygrid_bullet_free(World* world) {
    delete world;
}

// Moves the proxies to these spheres, as many as in the first call, and finds the pairs, valid until the next call.
// Returns false if memory is exhausted.
bool lazygrid_bullet_step(World* world, const Sphere* spheres, std::uint32_t n, const Pair** pairs, std::size_t* found) {
    try {
        step(*world, spheres, n);
        *pairs = world->pairs.data();
        *found = world->pairs.size();
        return true;
    } catch (...) {
        return false;
    }
}

}
