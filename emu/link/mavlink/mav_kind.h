/* Kinds of MAVLink ports (mav_port.h), for those who only choose one. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_KIND_H
#define PSABENCH_LINK_MAVLINK_MAV_KIND_H

enum mav_port_kind { MAV_UDP_OUT, MAV_UDP_IN, MAV_TCP, MAV_PTY };

#endif
