#include "core/control_groups.h"

#include <fstream>
#include <sstream>

namespace wive {
namespace {

bool is_among(std::string_view controller, const std::string& controllers) {
    std::istringstream names(controllers);
    for (std::string name; std::getline(names, name, ',');)
        if (name == controller) return true;
    return false;
}

}  // namespace

// In a container a group's path may be that of the host, where only `mount` itself exists.
void for_each_group(const std::string& root, std::string_view controller,
                    const std::function<void(const std::string& folder, GroupVersion version)>& use) {
    const std::string mount = root + "/sys/fs/cgroup";
    const auto use_all = [&](const std::string& top, std::string path, GroupVersion version) {
        use(top, version);
        for (; path.size() > 1 && path.front() == '/'; path.erase(path.rfind('/'))) use(top + path, version);
    };
    std::ifstream groups(root + "/proc/self/cgroup");
    // A line is "number:controllers:path"; version 2 has no controllers.
    for (std::string number, controllers, path;
         std::getline(groups, number, ':') && std::getline(groups, controllers, ':') && std::getline(groups, path);) {
        if (controllers.empty()) use_all(mount, path, GroupVersion::two);
        if (is_among(controller, controllers)) use_all(mount + "/" + std::string(controller), path, GroupVersion::one);
    }
}

}  // namespace wive
