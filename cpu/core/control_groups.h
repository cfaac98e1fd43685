// The control groups (containers) that this process is in.
#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace wive {

enum class GroupVersion { one, two };

// Calls use(folder, version) for the groups that limit this process, the outer ones too, in either version of the
// interface. controller: "memory" or "cpu". root: a folder that holds proc and sys, for tests.
void for_each_group(const std::string& root, std::string_view controller,
                    const std::function<void(const std::string& folder, GroupVersion version)>& use);

}  // namespace wive
